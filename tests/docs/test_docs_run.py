"""What the documents show is true: their commands run, their files and verbs and scenarios exist, their output is real.

Every page of docs/ that shows a command is followed, in a directory of its own in which the quick start has been
followed before: `runs/mrac-rs232-001` is there. Blocks are named in the line that opens them:

    sh test         runs line by line; `# exit 1` says which exit code to expect, without it 0
    sh same         runs, and each command prints the line below it
    sh not-run: WHY is not run, and says why
    sh terminal-1   and -2 run side by side
    text printed    is what the command before it printed, but for times and what depends on the machine
    yaml FILE       is that file
    python FILE     is that file; runs, unless it defines a class
    python cell     is a cell of a notebook: all of a page run in order, in one process, at the end

Pages that a program makes say so in a line `Made by ...`; their commands are not run.
"""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
import typer.main

from sil.cli import app
from sil.scenario import load_scenario
from sil.scenarios import list_scenarios

REPO = Path(__file__).resolve().parents[2]
DOCS = sorted(str(path.relative_to(REPO)) for path in (REPO / "docs").rglob("*.md"))
DOCUMENTS = ["README.md", "CHANGELOG.md", *DOCS]
FENCE = re.compile(r"^```(\S+)(?: ([^\n]+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
EXIT = re.compile(r"\s+# exit (\d+)$")
NAMES = {  # of the fenced blocks a page may have
    "sh": {"test", "same", "terminal-1", "terminal-2"},
    "text": {"", "printed"},
}
WAITING = (["the", "board", "is"], ["still", "waiting", "for"])  # for READY
PACED = ("--clock scaled", "--clock realtime")


class Block(NamedTuple):
    """A fenced block: language, its name (such as `test`), text."""

    language: str
    name: str
    text: str

    def commands(self) -> list[tuple[str, int]]:
        """(command, exit code) of every line."""
        lines = [line for line in self.text.splitlines() if line]
        return [(EXIT.sub("", line), int(found[1]) if (found := EXIT.search(line)) else 0) for line in lines]


def blocks(document: str) -> list[Block]:
    return [Block(*(part or "" for part in found)) for found in FENCE.findall((REPO / document).read_text())]


def named(document: str, language: str, name: str) -> Block:
    (found,) = [block for block in blocks(document) if (block.language, block.name) == (language, name)]
    return found


def is_made(document: str) -> bool:
    """By a program, whose own test says that it is current."""
    return bool(re.search(r"^Made by ", (REPO / document).read_text(), re.MULTILINE))


WRITTEN = [page for page in DOCS if not is_made(page)]
PAGES = [page for page in WRITTEN if any(block.name in ("test", "same", "cell") for block in blocks(page))]


def held_up(printed: str) -> bool:
    """A paced run passed, or says that this machine was too busy for its clock."""
    return bool(re.search("^(passed|degraded)|not reproducible", printed, re.MULTILINE))


def environment() -> dict[str, str]:
    """`sil` and `python` are this interpreter's; colours and widths do not depend on who runs the test."""
    here = str(Path(sys.executable).parent)
    set_here = {"COLUMNS": "100", "PYTHONSAFEPATH": "1", "MPLBACKEND": "Agg"}
    return {**os.environ, "PATH": f"{here}{os.pathsep}{os.environ['PATH']}", **set_here}


def shell(command: str, folder: Path, code: int | None = 0) -> str:
    """stdout and stderr of one command; asserts the exit code, None: any."""
    done = subprocess.run(
        command,
        shell=True,
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=120,
    )
    assert code in (None, done.returncode), (
        f"{command}: exit {done.returncode}, the document says {code}\n{done.stdout}"
    )
    return done.stdout


def files_of(document: str, folder: Path) -> Path:
    """The folder, with every file in it that the page shows."""
    for block in blocks(document):
        if block.language in ("yaml", "python") and block.name != "cell":
            (folder / block.name).write_text(block.text)
    return folder


# -- the pages -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def readme_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The README's first command without its installation; in lockstep, which it says gives the same bytes."""
    folder = tmp_path_factory.mktemp("readme")
    install, run = readme_commands()[0].split(" && ")
    assert install == "pip install ."
    return folder, shell(run.replace("scaled:20", "lockstep"), folder)


@pytest.mark.parametrize("page", PAGES)
def test_the_pages_commands_run_exit_and_print_as_they_say(
    page: str, tmp_path: Path, readme_run: tuple[Path, str]
) -> None:
    if page != "docs/quick-start.md":
        shutil.copytree(readme_run[0] / "runs", tmp_path / "runs")
    files_of(page, tmp_path)
    printed = ""
    for block in blocks(page):
        if (block.language, block.name) == ("sh", "test"):
            for command, code in block.commands():
                printed = follow(command, code, tmp_path)
        elif (block.language, block.name) == ("sh", "same"):
            for (command, code), (said, _) in zip(*[iter(block.commands())] * 2, strict=True):
                assert shell(command, tmp_path, code).strip() == said
        elif block.language == "python" and block.name != "cell" and "class " not in block.text:
            printed = shell(f"python {block.name}", tmp_path)
        elif (block.language, block.name) == ("text", "printed"):
            lines = iter(lasting(printed))  # progress, on stderr, may stand between those shown
            assert [shown for shown in lasting(block.text) if shown not in lines] == [], printed
    if cells := [block.text for block in blocks(page) if block.name == "cell"]:
        (tmp_path / "cells.py").write_text("\n".join(cells))
        shell("python cells.py", tmp_path)


def follow(command: str, code: int, folder: Path) -> str:
    """A busy machine may degrade a paced run: not the page's fault."""
    paced = any(clock in command for clock in PACED)
    printed = shell(command, folder, None if paced else code)
    assert not paced or held_up(printed), printed
    return printed


def test_pages_are_found() -> None:
    assert {"docs/quick-start.md", "docs/how-to/own-law.md", "docs/concepts/determinism.md"} <= set(PAGES)
    assert len(PAGES) >= 15


@pytest.mark.parametrize("page", WRITTEN)
def test_every_block_of_a_page_is_run_or_says_why_not(page: str) -> None:
    for block in blocks(page):
        if not re.match(r"not-run: \S+", block.name):
            assert block.name in NAMES.get(block.language, {block.name or "no name"}), block


@pytest.mark.parametrize("document", DOCUMENTS)
def test_links_lead_to_headings(document: str) -> None:
    """`ci.md#json` and `#json` name a heading as web pages of the repository spell it."""
    path = REPO / document
    for target in re.findall(r"\]\(([^)\s]*#[^)\s]+)\)", path.read_text()):
        name, _, anchor = target.partition("#")
        page = path.parent / name if name else path
        headings = re.findall(r"^#+ (.*)$", re.sub(FENCE, "", page.read_text()), re.MULTILINE)
        assert anchor in {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}, target


def test_two_terminals(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    page = "docs/how-to/two-machines.md"
    one, two = (named(page, "sh", f"terminal-{n}").text.strip().replace("5005", port) for n in (1, 2))
    board, plant = one, two.replace("scaled:20", "lockstep")
    with subprocess.Popen(board.split(), cwd=tmp_path, env=environment(), stdout=subprocess.PIPE, text=True) as serving:
        try:
            assert serving.stdout is not None and port in serving.stdout.readline()
            assert "passed" in shell(plant, tmp_path)
        finally:
            serving.terminate()


def test_scenarios_shown_are_valid_and_the_defaults_said_are_the_defaults(tmp_path: Path) -> None:
    files_of("docs/how-to/write-a-scenario.md", tmp_path)
    (tmp_path / "empty.yaml").write_text("{}\n")
    shown, default = (load_scenario(tmp_path / name).resolved() for name in ("keys.yaml", "empty.yaml"))
    remarked = {"name", "link", "law", "guidance", "require"}
    assert {key for key in shown if shown[key] != default[key]} <= remarked
    assert shown["guidance"]["reference"] == default["guidance"]["reference"]
    assert shown["guidance"]["wn_radps"] == default["guidance"]["wn_radps"]


# -- a stranger's law (row 11 of issue 1's table) ------------------------------------------------------------------


def test_the_examples_are_shown_as_they_are_and_a_strangers_law_has_25_lines() -> None:
    """That they run, replay and plot is their page's test."""
    for language, name in (("python", "my_pd.py"), ("yaml", "my-pd.yaml")):
        text = (REPO / "docs" / "examples" / name).read_text()
        assert named("docs/how-to/own-law.md", language, name).text == text
        assert name != "my_pd.py" or len(text.splitlines()) <= 25


# -- the README ----------------------------------------------------------------------------------------------------


def readme_commands() -> list[str]:
    return [command for block in blocks("README.md") if block.language == "sh" for command, _ in block.commands()]


def test_the_readme_prints_what_the_program_prints(readme_run: tuple[Path, str]) -> None:
    assert lasting(named("README.md", "text", "").text) == lasting(readme_run[1])


def lasting(output: str) -> list[list[str]]:
    """Words of every line, but for times, lateness and the sha256, which depend on the machine and on versions.

    Nor what a busy machine says while it compiles: that the board is not ready yet.
    """
    lines = (re.split(r" s in |points in |sha256", line)[0].split() for line in output.splitlines())
    return [line for line in lines if line[:1] not in (["wake-ups"], ["late"]) and line[:3] not in WAITING]


def test_the_readmes_other_commands_run(readme_run: tuple[Path, str]) -> None:
    others = [command for command in readme_commands() if command.startswith("sil ")]
    assert [command.split()[1] for command in others] == ["plot", "report", "replay"]
    assert "identical: 1200 ticks, 1 session" in [shell(command, readme_run[0]).strip() for command in others]


def test_the_readmes_clock_is_accepted(tmp_path: Path) -> None:
    """That all clocks give the same bytes is tests/e2e/test_same_bytes.py's."""
    run = readme_commands()[0].split(" && ")[1] + " --set duration_s=20"
    assert "--clock scaled:20" in run
    assert held_up(shell(run, tmp_path, None))


def test_make_check_is_a_target() -> None:
    assert "make check" in readme_commands()
    assert re.search(r"^check:", (REPO / "Makefile").read_text(), re.MULTILINE)


# -- names ---------------------------------------------------------------------------------------------------------


def test_the_readmes_tree_names_what_exists() -> None:
    tree = re.findall(r"^    (\S+)  +\S", (REPO / "README.md").read_text().split("## What is where")[1], re.MULTILINE)
    assert len(tree) >= 10
    assert [name for name in tree if not (REPO / name).exists()] == []
    packages = {path.parent.name + "/" for path in REPO.glob("*/__init__.py")}
    assert packages <= set(tree)


@pytest.mark.parametrize("document", DOCUMENTS)
def test_links_and_file_names_exist(document: str) -> None:
    text, folder = (REPO / document).read_text(), (REPO / document).parent
    targets = [target.partition("#")[0] for target in re.findall(r"\]\(([^)\s]+)\)", text) if "://" not in target]
    assert [target for target in targets if target and not (folder / target).exists()] == []
    # sil/msg/... are schemas
    files = re.findall(r"`((?:sil(?!/msg/)|protocol|firmware_sim|tests|tools|docs)/[\w./-]+)`", text)
    assert [file for file in files if "NAME" not in file and not (REPO / file).exists()] == []


@pytest.mark.parametrize("document", DOCUMENTS)
def test_verbs_and_scenarios_exist(document: str) -> None:
    text = (REPO / document).read_text()
    verbs = set(typer.main.get_command(app).commands)  # type: ignore[attr-defined]
    said = set(re.findall(r"(?:^|`)sil ([a-z][a-z-]*)", text, re.MULTILINE))
    assert said <= verbs
    known = {entry.name for entry in list_scenarios()}
    ran = set(re.findall(r"sil (?:run|plant|check) ([a-z][a-z0-9-]+)(?=[ `]|$)", text, re.MULTILINE))
    assert ran - known <= {"no-such-scenario"}


def test_every_verb_stands_in_the_readme_and_every_scenario_in_its_table() -> None:
    readme, table = (REPO / "README.md").read_text(), (REPO / "docs/reference/scenarios.md").read_text()
    verbs = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    assert [verb for verb in verbs if f"`{verb}`" not in readme] == []
    assert [entry.name for entry in list_scenarios() if f"`{entry.name}`" not in table] == []
