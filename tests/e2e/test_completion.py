"""What TAB offers: names that exist, keys that --set takes, and nothing heavy imported for it.

The shells' part is typer's; here its protocol is spoken as their scripts speak it, and bash's own script runs once.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sil.scenario import load_scenario
from sil.scenarios import list_scenarios
from sil.verbs import completion

BIN = Path(sys.executable).parent
HEAVY = ("numpy", "pydantic", "scipy", "numba", "mcap", "matplotlib", "serial")


def words(offers: list[tuple[str, str]]) -> list[str]:
    return [word for word, _ in offers]


def sets(incomplete: str, *arguments: str, **params: object) -> list[str]:
    """What is offered behind --set; `arguments`: what stands on the line and was not taken by a parameter."""
    context = SimpleNamespace(params={"scenario": None, **params}, args=list(arguments))
    return words(completion.sets(context, incomplete))  # type: ignore[arg-type]


def leaves(prefix: str = "") -> list[str]:
    """Every key that TAB can reach, section by section."""
    found = []
    for word in sets(prefix, "mrac-rs232"):
        if word.endswith("."):
            found += leaves(word)
        elif word.endswith("="):
            found.append(word.removesuffix("="))
    return found


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_scenarios_are_the_built_ins_and_the_files_here(here: Path) -> None:
    (here / "mine.yaml").touch()
    (here / "notes.txt").touch()
    assert words(completion.scenarios("")) == [*(info.name for info in list_scenarios()), "mine.yaml"]
    assert words(completion.scenarios("mi")) == ["mine.yaml"]
    assert completion.scenarios("deep/er") == []  # the shell's own file names then


def test_runs_are_directories_with_a_log(here: Path) -> None:
    for name, text in {"runs/a-001": '{"verdict": "passed"}', "runs/a-002": "broken", "b": "{}"}.items():
        (here / name).mkdir(parents=True)
        (here / name / "run.mcap").touch()
        (here / name / "summary.json").write_text(text)
    (here / "runs/empty").mkdir()
    assert dict(completion.runs("")) == {"runs/a-001": "passed", "runs/a-002": "no summary", "b": "no summary"}
    assert words(completion.runs("runs/a-002")) == ["runs/a-002"]


def resolved_keys() -> dict[str, object]:
    """Every key of a scenario with its value; a section that is off (null) is one key."""

    def keys(values: dict[str, object], prefix: str = "") -> dict[str, object]:
        found: dict[str, object] = {}
        for name, value in values.items():
            found |= keys(value, f"{prefix}{name}.") if isinstance(value, dict) else {prefix + name: value}
        return found

    return keys(load_scenario("mrac-rs232").resolved())


def off(key: str) -> str:
    """The section that is off and holds this key, or ""."""
    sections = [known for known, value in resolved_keys().items() if value is None]
    return next((known for known in sections if key.startswith(f"{known}.")), "")


def test_every_key_of_a_scenario_can_be_reached_and_no_other() -> None:
    """Keys come from the schema, so that they cannot fall behind the model."""
    assert sorted({off(key) or key for key in leaves()}) == sorted({*resolved_keys(), "variant"})


def test_a_key_comes_with_its_values() -> None:
    assert sets("law.f", "mrac-rs232") == ["law.form=", "law.form=fixed", "law.form=float"]
    assert sets("law.form=fl") == ["law.form=float"]
    assert sets("sensors.rate.en") == ["sensors.rate.enabled=" + end for end in ("", "false", "true")]
    assert sets("guidance.pro")[1:] == [f"guidance.profile={name}" for name in ("A", "B", "hold", "steps")]
    assert sets("nonsense") == []


def test_values_that_are_offered_are_taken() -> None:
    """An offer that the loader refuses is a trap; only a profile of steps, and a section that is off, need more."""
    for key in {key for key in leaves() if not off(key)} - {"guidance.profile"}:
        for word in sets(f"{key}=", "mrac-rs232"):
            if not word.endswith("="):
                load_scenario("mrac-rs232", [word])


@pytest.mark.parametrize(
    ("arguments", "params"),
    [(("pd-root-locus",), {}), ((), {"scenario": "pd-root-locus"}), ((), {"set_": ["law.name=pd"], "scenario": "x"})],
)
def test_parameters_are_those_of_the_law_on_the_line(arguments: tuple[str, ...], params: dict[str, object]) -> None:
    assert {word.partition("=")[0] for word in sets("law.params.", *arguments, **params)} == {
        f"law.params.{name}" for name in ("kp_bits", "kd_bits", "kp", "kd", "rate", "error")
    }


def test_without_a_scenario_the_parameters_of_all_laws_are_offered() -> None:
    offered = sets("law.params.", "no-such-scenario")
    assert {"law.params.kappa=", "law.params.kp_bits=", "law.params.observer_pole="} <= set(offered)


def ask(shell: str, line: str, folder: Path) -> str:
    """What `sil` prints when a shell asks it to complete `line`."""
    environment = {**os.environ, "_SIL_COMPLETE": f"complete_{shell}", "_TYPER_COMPLETE_ARGS": line,
                   "_TYPER_COMPLETE_FISH_ACTION": "get-args", "COMP_WORDS": line.replace(" ", "\n"),
                   "COMP_CWORD": str(line.count(" "))}  # fmt: skip
    command = [str(BIN / "sil")]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=60)
    assert done.stderr == ""
    return done.stdout


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_gets_words_and_what_they_mean(shell: str, tmp_path: Path) -> None:
    assert "mrac-rs232" in ask(shell, "sil run mrac", tmp_path)
    printed = ask(shell, "sil run mrac-rs232 --set law.f", tmp_path)
    assert "law.form=fixed" in printed
    assert shell == "bash" or "seed" not in printed


def test_a_meaning_is_one_line_for_zsh(tmp_path: Path) -> None:
    """A broken one ends the list of words that zsh evaluates."""
    printed = ask("zsh", "sil run ", tmp_path)
    assert len(printed.strip().splitlines()) == len(list_scenarios())


@given(st.lists(st.text("ab=:.", min_size=1, max_size=9), min_size=1))
def test_bashs_pieces_are_words_again(line: list[str]) -> None:
    """As bash takes them apart: at every run of = or :; a word that begins with one is lost in the word before."""
    line = [word if word.strip("=:")[:1] == word[:1] else f"a{word}" for word in line]
    whole = [line[0]]
    for word in line[1:]:  # a run at the end of a word, or at its start, glues the next one to it
        whole = [*whole[:-1], whole[-1] + word] if whole[-1][-1] in "=:" else [*whole, word]
    assert completion.rejoined([piece for word in line for piece in re.findall(r"[=:]+|[^=:]+", word)]) == whole


@pytest.mark.parametrize(
    ("typed", "offer", "rest"),
    [("law.form=fl", "law.form=float", "float"), ("law.form=", "law.form=fixed", "fixed"),
     ("udp:", "udp://h:5", "//h:5"), ("scaled:2", "scaled:20", "20"), ("--clock=l", "lockstep", "lockstep"),
     ("mrac", "mrac-rs232", "mrac-rs232"),
     ("--link=udp:/", "udp://h:5", "//h:5")],
)  # fmt: skip
def test_bash_gets_what_it_puts_behind_the_last_break(typed: str, offer: str, rest: str) -> None:
    assert completion.behind(typed, offer) == rest


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
def test_bash_completes(tmp_path: Path) -> None:
    """The script that --show-completion prints, in bash itself; `; true` keeps bash the parent that typer looks for."""
    script = """eval "$(bash -c 'sil --show-completion; true')"
        COMP_WORDS=(sil run pd); COMP_CWORD=2; _sil_completion sil; echo "${COMPREPLY[@]}"
        COMP_WORDS=(sil run x --set law.form = fl); COMP_CWORD=6; _sil_completion sil; echo "${COMPREPLY[@]}"
        COMP_WORDS=(sil run x --clock scaled :); COMP_CWORD=5; _sil_completion sil; echo "${COMPREPLY[@]}" """
    environment = {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(
        ["bash", "-c", script], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60
    )
    assert done.stdout == "pd-root-locus\nfloat\n20\n"


@pytest.mark.parametrize(
    "code",
    ["import sil.cli",
     "from sil.verbs import completion as c; from types import SimpleNamespace as S; "
     "c.scenarios(''); c.runs(''); c.links(''); c.sets(S(params={}, args=['mrac-rs232']), 'law.params.')"],
    ids=["help", "completion"],
)  # fmt: skip
def test_a_person_who_waits_waits_for_nothing_heavy(code: str, tmp_path: Path) -> None:
    """numpy alone takes as long as the whole of `sil -h`."""
    check = f"import sys; {code}; print([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-P", "-c", check], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.stdout == "[]\n", done.stderr
