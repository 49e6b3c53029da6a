"""Conditions as a file, and draws that depend on the seed and nothing else."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from sil.campaign.conditions import conditions_from
from sil.campaign.draws import latin_hypercube, rows
from sil.trouble import UsageError

FILE = """
about: two keys
sample: lhs
draws: 10
seed: 3
set: {duration_s: 5}
vary:
  sensors.attitude.noise_deg: uniform(0.01, 0.05)
  law.params.c2_pole: [0.7, 0.8]
"""


def test_options_go_before_the_file(tmp_path):
    (tmp_path / "c.yaml").write_text(FILE)
    alone = conditions_from(tmp_path / "c.yaml", (), None, None, None)
    assert (alone.sample, alone.draws, alone.seed, alone.sets) == ("lhs", 10, 3, ("duration_s=5",))
    assert [(spec.key, spec.spec) for spec in alone.specs] == [
        ("sensors.attitude.noise_deg", "uniform(0.01, 0.05)"),
        ("law.params.c2_pole", (0.7, 0.8)),
    ]
    over = conditions_from(tmp_path / "c.yaml", ["law.params.c2_pole=0.9", "seed=1:2"], "random", 4, 0)
    assert (over.sample, over.draws, over.seed) == ("random", 4, 0)
    assert [spec.spec for spec in over.specs] == ["uniform(0.01, 0.05)", "0.9", "1:2"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("vary: {a: 1}\ndrows: 3", "c.yaml:2: drows: unknown key"),
        ("vary: {a: 1}\nsample: sobol", "c.yaml:2: sample: expected one of random, lhs"),
        ("vary: {a: 1}\ndraws: 0", "c.yaml:2: draws: expected a whole number from 1"),
        ("vary: [1]", "expected a mapping"),
        ("draws: 3", "at least one KEY=SPEC"),
        ("vary: {a: 1, a: 2}", "each key once"),
    ],
)
def test_a_mistake_in_the_file_is_told_with_its_line(tmp_path, monkeypatch, text, said):
    monkeypatch.chdir(tmp_path)
    Path("c.yaml").write_text(text)
    with pytest.raises(UsageError) as caught:
        conditions_from(Path("c.yaml"), (), None, None, None)
    assert said in str(caught.value)


def test_an_axis_keeps_its_draws_whatever_else_is_varied_and_drawn():
    few = list(itertools.islice(rows("random", 7, ["a", "b"], 5), 5))
    many = list(itertools.islice(rows("random", 7, ["c", "b"], 50), 50))
    assert [row[1] for row in few] == [row[1] for row in many[:5]]
    assert [row[0] for row in few] != [row[0] for row in many[:5]]
    assert few != list(itertools.islice(rows("random", 8, ["a", "b"], 5), 5))


def test_a_latin_hypercube_has_one_draw_in_each_part_of_each_axis():
    cube = np.array(latin_hypercube(42, 4, 25))
    assert cube.shape == (25, 4)
    for column in cube.T:
        assert sorted(np.floor(column * 25)) == list(range(25))
    assert [tuple(row) for row in cube] == latin_hypercube(42, 4, 25)
    assert latin_hypercube(43, 4, 25) != latin_hypercube(42, 4, 25)


def test_what_replaces_a_refused_row_of_a_hypercube_is_not_one_of_its_rows():
    six = list(itertools.islice(rows("lhs", 1, ["a"], 5), 6))
    assert six[:5] == latin_hypercube(1, 1, 5)
    assert six[5] not in six[:5]
