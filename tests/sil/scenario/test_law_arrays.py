"""Lists and matrices among a law's parameters: the numbers there are, the others zero; a line for each mistake."""

from __future__ import annotations

from typing import Any

import pytest

from sil.configure import orders
from sil.scenario import load_scenario, load_values
from sil.scenario_errors import ScenarioInvalid

TWO: dict[str, Any] = {"A": ((1.0, 0.25), (0.0, 0.5)), "B": (0.5, 1.0), "C": (2.0, 1.0), "D": 3.0}


def loaded(**params: Any) -> Any:
    return load_values({"law": {"name": "state_space", "params": params}})


def test_numbers_are_the_words_and_the_rest_is_zero() -> None:
    values = orders(loaded(**TWO)).configuration.values
    assert [values[name] for name in ("A_1_1", "A_1_2", "A_2_1", "A_2_2", "B_1", "B_2", "C_1")] == [
        1.0, 0.25, 0.0, 0.5, 0.5, 1.0, 2.0
    ]  # fmt: skip
    assert not any(values[f"A_{i}_{j}"] for i in range(1, 9) for j in range(1, 9) if max(i, j) > 2)


def test_a_resolved_scenario_has_them_as_they_were_given() -> None:
    scenario = loaded(**TWO)
    resolved = scenario.resolved()
    assert resolved["law"]["params"]["A"] == [[1.0, 0.25], [0.0, 0.5]]
    assert orders(load_values(resolved)).words == orders(scenario).words


def test_defaults_go_together() -> None:
    params = loaded().law.params
    assert [len(params[name]) for name in "ABC"] == [3, 3, 3] and len(params["A"][2]) == 3
    assert orders(load_values(loaded().resolved())).words == orders(loaded()).words
    assert loaded(A=(), B=(), C=(), D=1.0).law.params["A"] == ()


def test_an_override_takes_yaml() -> None:
    sets = ["law.name=state_space", "law.params.A=[[1]]", "law.params.B=[2]", "law.params.C=[3]"]
    assert orders(load_scenario("pd-root-locus", sets)).configuration.values["C_1"] == 3.0


@pytest.mark.parametrize(
    ("change", "key", "expected"),
    [
        ({"A": 3.0}, "A", "at most 8 rows of 8 numbers from -1000 to 1000, got 3"),
        ({"A": ((1.0,),) * 9}, "A", "at most 8 rows of 8 numbers"),
        ({"A": ((1.0, 2000.0), (0.0, 1.0))}, "A", "at most 8 rows of 8 numbers from -1000 to 1000, got"),
        ({"A": ((1.0, 2.0), (0.0,))}, "A", "2 rows of 2 numbers, as B has, got"),
        ({"A": ((1.0, 2.0, 3.0), (0.0, 1.0, 2.0))}, "A", "2 rows of 2 numbers, got"),
        ({"B": (1.0, 2.0, 3.0)}, "B", "2 numbers, as A has, got"),
        ({"B": None}, "B", "at most 8 numbers from -1e+06 to 1e+06 1/rad, got null"),
        ({"C": ("x", 1.0)}, "C", "at most 8 numbers from -1e+06 to 1e+06 N m, got"),
        ({"a": 1.0}, "a", "known: error, "),
    ],
)
def test_each_mistake_is_one_line(change: dict[str, Any], key: str, expected: str) -> None:
    with pytest.raises(ScenarioInvalid) as error:
        loaded(**{**TWO, **change})
    lines = [str(problem) for problem in error.value.problems]
    assert len(lines) == 1 and f"law.params.{key}: " in lines[0] and expected in lines[0], lines


def test_one_of_them_alone_is_not_enough() -> None:
    with pytest.raises(ScenarioInvalid) as error:
        loaded(A=TWO["A"], B=TWO["B"])
    (problem,) = error.value.problems
    assert "law.params.C: expected 2 numbers, as A has, got nothing" in str(problem)
