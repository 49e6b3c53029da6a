"""The ladder as a table, as lines below it, and as JSON."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from sil.ladder.climb import Step, exit_code_of
from sil.report.diff import Difference
from sil.report.diff import text as difference_text
from sil.screen import requirement_text
from sil.screen.palette import BAD, GOOD, WARN
from sil.trouble import EXIT_INTERRUPTED, EXIT_LINK, EXIT_OK, EXIT_REQUIREMENT

WIDE = 130  # columns from which on what runs fits into the table
NOT_SHOWN = "not shown"
WORDS = {EXIT_OK: "passed", EXIT_REQUIREMENT: "failed", EXIT_LINK: NOT_SHOWN, EXIT_INTERRUPTED: "interrupted"}
COLOURS = {"passed": GOOD, "failed": BAD, "degraded": WARN, NOT_SHOWN: WARN, "interrupted": WARN}
SHA_SHOWN = 8  # hexadecimal digits; --json has all 64


def verdict(steps: Sequence[Step], interrupted: bool = False) -> str:
    """Of the whole ladder: what is wrong for certain comes before what is not shown, unlike in the exit code.

    interrupted: between two rungs, so that no step says so.
    """
    code = _exit_code(steps, interrupted)
    if code == EXIT_LINK and any(step.differs or step.exit_code == EXIT_REQUIREMENT for step in steps):
        code = EXIT_REQUIREMENT
    return WORDS[code]


def _exit_code(steps: Sequence[Step], interrupted: bool) -> int:
    return EXIT_INTERRUPTED if interrupted else exit_code_of(steps)


# -- for people --------------------------------------------------------------------------------------------------------


def table(steps: Sequence[Step], width: int) -> Table:
    """A row a rung. width: columns of the terminal; what runs is left to `legend` where it does not fit."""
    made = Table(box=None, pad_edge=False, header_style="bold")
    made.add_column("rung")
    if width >= WIDE:
        made.add_column("what runs")
    made.add_column("verdict")
    for head in ("angle\ndeg", "torque\nN m", "differs\nat tick", "instr.\nper step", "x real\ntime"):
        made.add_column(head, justify="right")
    made.add_column("sha256")
    for step in steps:
        about = (Text(step.rung.about),) if width >= WIDE else ()
        made.add_row(Text(_short(step.rung.name), "bold"), *about, _verdict(step), *_figures(step))
    return made


def legend(steps: Sequence[Step], width: int) -> Iterator[str]:
    """What the table has no room for: what runs on each rung, and what its columns mean."""
    if width < WIDE:
        yield from (f"{_short(step.rung.name):<10}{step.rung.about}" for step in steps)
        yield ""
    yield "angle, torque: largest deviation from the rung below; differs at tick: the first"
    yield "with another frame; instr.: of the law's step, mean"


def found(steps: Sequence[Step]) -> Iterator[Text]:
    """What is wrong, a line each; the first differing frame is decoded."""
    for step in steps:
        if step.why_not:
            yield Text.assemble((f"{step.rung.name}: ", WARN), step.why_not.removeprefix(f"{step.rung.name}: "))
        elif step.summary["failure"]:
            yield Text.assemble((f"{step.rung.name}: ", BAD), step.summary["failure"])
        for line in step.summary.get("require", ()):
            if not line["passed"]:
                yield Text.assemble((f"{step.rung.name}: not met: ", BAD), requirement_text(line))
        if step.not_counted:
            yield Text.assemble((f"{step.rung.name}: ", WARN), f"instructions not counted: {step.not_counted}")
        if step.differs and step.difference is not None:
            yield from _what_differs(step, step.difference, _same_bytes(step, steps))


def _what_differs(step: Step, difference: Difference, twin: str) -> Iterator[Text]:
    """twin: name of a lower rung with the same bytes, "" where there is none: else it is that one that is odd."""
    if twin:
        yield Text(f"{step.rung.name} is {twin}, bit for bit, but not {step.below}", style=BAD)
        return
    yield Text(f"{step.rung.name} (b) is not {step.below} (a), bit for bit:", style=BAD)
    yield Text(difference_text(difference), no_wrap=True, overflow="ignore")


def _same_bytes(step: Step, steps: Sequence[Step]) -> str:
    below = steps[: steps.index(step)]
    return next((each.rung.name for each in below if each.summary.get("sha256") == step.summary["sha256"]), "")


def last_line(steps: Sequence[Step], name: str, folder: Path, interrupted: bool = False) -> Text:
    """`passed  mrac-rs232: 4 rungs, fixed, native, cortex-m identical; runs/mrac-rs232-ladder-001`"""
    word = verdict(steps, interrupted)
    same = [step for step in steps if step.same_form]
    if any(step.differs for step in same):
        said = f"{', '.join(step.rung.name for step in same if step.differs)} not bit for bit as below"
    elif same:
        said = f"{same[0].below} = {' = '.join(step.rung.name for step in same)}, bit for bit"
    else:
        said = "no two rungs in the same arithmetic"
    count = sum(bool(step.summary) for step in steps)
    told = f"  {name}: {count} of {len(steps)} rungs flown; {said}\nruns: {folder}"
    return Text.assemble((word, COLOURS[word]), told)


def _short(name: str) -> str:
    return "hardware" if "://" in name else name


def _verdict(step: Step) -> Text:
    word = str(step.summary["verdict"]) if step.summary else NOT_SHOWN
    return Text(word, style=COLOURS.get(word, ""))


def _figures(step: Step) -> tuple[Text | str, ...]:
    if not step.summary:
        return ("-",) * 6
    times = step.summary["timing"]["times_real_time"]
    sha256 = step.summary["sha256"][:SHA_SHOWN]
    compared = ("-",) * 3 if step.difference is None else _compared(step, step.difference)
    counted = f"{step.instructions.mean:,.0f}" if step.instructions is not None else "-"
    return (*compared, counted, f"{times:,.0f}" if times >= 10 else f"{times:.2g}", sha256)


def _compared(step: Step, difference: Difference) -> tuple[Text, ...]:
    """Deviations and first differing tick; what has to be the same and is not stands out."""
    truth, tick = difference.truth, first_tick(difference)
    style = BAD if step.differs else ""
    angle, torque = (truth.max_attitude_deg, truth.max_torque_Nm) if truth is not None else (0.0, 0.0)
    cells = (f"{angle:.2g}", f"{torque:.2g}", "none" if tick is None else str(tick))
    return tuple(Text(cell, style=style) for cell in cells)


def first_tick(difference: Difference) -> int | None:
    """The first tick where any deterministic frame is another, CONFIG apart; None: every frame is the same."""
    return difference.packet.tick if difference.packet is not None else None


# -- for programs ------------------------------------------------------------------------------------------------------


def as_dict(steps: Sequence[Step], name: str, folder: Path, interrupted: bool = False) -> dict[str, Any]:
    """Plain JSON values."""
    return {
        "scenario": name,
        "verdict": verdict(steps, interrupted),
        "exit_code": _exit_code(steps, interrupted),
        "ladder_dir": str(folder),
        "rungs": [_step(step) for step in steps],
    }


def _step(step: Step) -> dict[str, Any]:
    summary, difference = step.summary, step.difference
    truth = difference.as_dict()["truth"] if difference is not None else None
    return {
        "rung": step.rung.name,
        "runs": step.rung.about,
        "form": step.rung.form,
        "verdict": summary.get("verdict", NOT_SHOWN),
        "exit_code": step.exit_code,
        "why_not": step.why_not or summary.get("failure", ""),
        "run_dir": summary.get("run_dir"),
        "ticks": summary.get("ticks", 0),
        "sha256": summary.get("sha256"),
        "times_real_time": summary["timing"]["times_real_time"] if summary else None,
        "instructions_per_step": step.instructions._asdict() if step.instructions is not None else None,
        "require": summary.get("require", []),
        "compared_with": step.below or None,
        "must_be_identical": step.same_form,
        "identical": difference.identical and difference.same_file if difference is not None else None,
        "max_attitude_deg": None if difference is None else truth["max_attitude_deg"] if truth else 0.0,
        "max_torque_Nm": None if difference is None else truth["max_torque_Nm"] if truth else 0.0,
        "first_differing_tick": first_tick(difference) if difference is not None else None,
        "first_difference": difference.as_dict()["packet"] if difference is not None else None,
        "config": difference.as_dict()["config"] if difference is not None else [],
    }
