"""One run from scenario to verdict: run directory, journal, loop, seal, metrics, summary.json."""

from __future__ import annotations

import hashlib
import json
import math
import platform
import time
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from protocol import events, frames
from protocol.links import LinkError
from sil import lateness
from sil.checks import check
from sil.link_counts import fates
from sil.live_view import LiveOrder, NoView, live_view
from sil.metrics import Judgement, as_json, judge, measure
from sil.plain import plain
from sil.realtime import Granted, granted, refuse_impossible, suspended_ns
from sil.rig import Rig, assemble, record_config, user_law_spec
from sil.runs import open_run
from sil.scenario import Scenario
from sil.signals import Motion
from sil.sinks.journal import Journal, JournalError
from sil.sinks.recorder import JournalRecorder
from sil.sinks.seal import SealReport, seal
from sil.stopping import StopRequests
from sil.trouble import (
    EXIT_INTERRUPTED,
    EXIT_LINK,
    EXIT_OK,
    EXIT_REQUIREMENT,
    LinkFailure,
    UsageError,
)
from sil.user_plant import sha256_of
from sil.watch import Guarded, Watch

PORT_COUNTERS = ("crc_errors", "discarded_bytes", "unknown", "sequence_gaps", "duplicates", "strangers")
MANY_TICKS = 20_000  # whose log takes more than two seconds to seal
NUMBERS_DEPEND_ON = ("numpy", "numba")


def run_scenario(
    scenario: Scenario,
    out: Path | None = None,
    watch: Watch | None = None,
    wired: bool = False,
    live: LiveOrder | None = None,
) -> dict[str, Any]:
    """Run a scenario and leave a complete run directory; returns the summary, which is also in summary.json.

    out: run directory, refused if it is not empty; None makes runs/NAME-NNN. SIGINT and SIGTERM end the run at the
    next tick, with log and summary complete. Raises UsageError before anything was run; a link or board that fails
    later is in the summary (`failure`, exit code 3), since what was recorded until then is kept. wired: somebody else
    starts the board; wait for it. live: viewers may look on; the summary then says under `live` what they were shown.
    """
    watch = Guarded(watch) if watch is not None else Watch()
    refuse_hopeless(scenario)
    refuse_impossible(scenario.clock)
    with live_view(live, scenario, watch) as view:
        return _run(scenario, out, watch, wired, view)


def _run(scenario: Scenario, out: Path | None, watch: Watch, wired: bool, view: NoView) -> dict[str, Any]:
    folder, made = new_run_dir(scenario.name, out)
    try:
        journal = Journal(folder / "run.journal")
    except JournalError as error:
        raise UsageError(str(error)) from None
    recorder = JournalRecorder(journal, watch.event)
    view.look_at(folder)
    with StopRequests() as stop:
        outcome = _fly(scenario, folder, made, recorder, stop, watch, wired)
        watch.stage("seal")
        if outcome.ticks > MANY_TICKS:
            watch.note(f"sealing the log of {outcome.ticks} ticks")
        report = seal(folder)
        if report.too_late:
            watch.note(f"{report.too_late} records came too late to stand in their place in run.mcap: left out")
        summary = _summary(scenario, folder, outcome, report)
        if (shown := view.finish(watch)) is not None:
            summary["live"] = shown
        text = json.dumps(summary, indent=2, allow_nan=False) + "\n"
        (folder / "summary.json").write_text(text, encoding="utf-8")
    if outcome.error is not None:
        raise outcome.error  # not foreseen: with its traceback, after everything was saved
    return summary


def refuse_hopeless(scenario: Scenario) -> None:
    """What `sil check` calls an error is not run: UsageError, a line each (`expect_missed` admits missed deadlines)."""
    errors = [str(finding) for finding in check(scenario) if finding.severity == "error"]
    if errors:
        raise UsageError("\n".join(errors))


class Outcome:
    """How the loop ended, before anything is read back."""

    def __init__(self) -> None:
        self.ticks = 0
        self.reason = "failed"
        self.failure = ""
        self.error: Exception | None = None
        self.wall_s = 0.0
        self.start_s = 0.0
        self.suspended_s = 0.0
        self.granted: Granted | None = None
        self.rig: Rig | None = None


def _fly(
    scenario: Scenario,
    folder: Path,
    made: bool,
    recorder: JournalRecorder,
    stop: StopRequests,
    watch: Watch,
    wired: bool,
) -> Outcome:
    """Assemble, loop, take down; the journal is closed with END whatever happened once it had begun."""
    outcome = Outcome()
    started = time.perf_counter()
    watch.stage("start")
    try:
        rig = outcome.rig = assemble(scenario, recorder, folder / "board.log", watch.note, wired)
    except BaseException as error:
        _discard(folder, made, recorder, keep_last_words=not isinstance(error, KeyboardInterrupt | UsageError))
        raise
    stop.hold()
    watch.plugged(scenario, rig)
    recorder.start(identity(scenario, rig), host_facts(scenario, rig))
    recorder.session(0)
    record_config(rig, recorder, 0)
    outcome.start_s = time.perf_counter() - started
    watch.stage("run")
    began, asleep_ns = time.perf_counter(), suspended_ns()

    def show(tick: int, motion: Motion) -> None:
        watch.tick(tick, scenario.ticks, motion)

    try:
        with granted(scenario.clock, rig.clock.paced, rig.host.pid if rig.host is not None else None) as got:
            outcome.granted = got
            for line in got.refused:
                watch.note(line)
            began, asleep_ns = time.perf_counter(), suspended_ns()
            _, outcome.reason = rig.loop.run(stop.asked, show)
    except (LinkError, LinkFailure, JournalError) as error:
        outcome.failure = _why(rig, error)
    except Exception as error:
        outcome.failure, outcome.error = f"{type(error).__name__}: {error}", error
    finally:
        outcome.ticks = rig.loop.ticks_done
        outcome.wall_s = time.perf_counter() - began
        outcome.suspended_s = (suspended_ns() - asleep_ns) // 1_000_000 / 1e3
        rig.stop({"finished": frames.STOP_DONE, "interrupted": frames.STOP_INTERRUPTED}.get(outcome.reason, 2))
        _close(recorder, outcome)
    return outcome


def _why(rig: Rig, error: Exception) -> str:
    """One line; a link that closed, or a board that is silent or says HELLO, is explained by the board if it can."""
    return rig.host.post_mortem(error) if rig.host is not None and not isinstance(error, JournalError) else str(error)


def _close(recorder: JournalRecorder, outcome: Outcome) -> None:
    try:
        recorder.end(max(outcome.ticks - 1, 0), outcome.reason, outcome.ticks)
    except JournalError as error:
        outcome.failure = outcome.failure or str(error)


def _discard(folder: Path, made: bool, recorder: JournalRecorder, keep_last_words: bool) -> None:
    """Nothing was run: leave nothing half-made behind (a board's last words stay, if there are any to keep)."""
    recorder.close()
    (folder / "run.journal").unlink(missing_ok=True)
    log = folder / "board.log"
    if log.exists() and not (keep_last_words and log.stat().st_size):
        log.unlink()
    if made and not any(folder.iterdir()):
        folder.rmdir()


# -- identity ------------------------------------------------------------------------------------------------------


def identity(scenario: Scenario, rig: Rig) -> dict[str, Any]:
    """META: everything that decides the numbers, and nothing of clock, link, board or host."""
    meta: dict[str, Any] = {
        "scenario": scenario.identity(),
        "name": scenario.name,
        "seed": scenario.seed,
        "period_ns": scenario.period_ns,
        "ticks": scenario.ticks,
        "layout_hash": f"{frames.LAYOUT_HASH:08x}",
        "versions": {"attitude-sil": version("attitude-sil")} | {name: version(name) for name in NUMBERS_DEPEND_ON},
    }
    if plant := sha256_of(scenario):
        meta["plant_file_sha256"] = plant
    if rig.orders is not None:
        table = rig.orders.table
        meta["law"] = {"name": table.name, "id": table.law_id, "version": table.version}
        meta["law_table_hash"] = f"{rig.orders.configuration.hash:08x}"
        meta["law_file_sha256"] = _law_file_sha256(scenario)
    return meta


def _law_file(scenario: Scenario) -> str:
    """Where a user's own law came from, for replay; "" for a law of the product."""
    return user_law_spec(scenario).rpartition(":")[0]


def _law_file_sha256(scenario: Scenario) -> str:
    """Of the file of a user's own law; "" for a law of the product."""
    file = _law_file(scenario)
    return hashlib.sha256(Path(file).read_bytes()).hexdigest() if file else ""


def host_facts(scenario: Scenario, rig: Rig) -> dict[str, Any]:
    """HOST: what describes this machine, link and board; timing.mcap only."""
    board = rig.session.board if rig.session is not None else None
    kind, url = rig.plugged
    return {
        "clock": scenario.clock.mode,
        "link": url,
        "baud": scenario.link.baud,
        "board": kind,
        "board_build": board.build if board is not None else "",
        "python": platform.python_version(),
        "platform": platform.platform(),
        "machine": platform.machine(),
    }


# -- run directory -------------------------------------------------------------------------------------------------


def new_run_dir(name: str, out: Path | None) -> tuple[Path, bool]:
    """(`out`, made if it is not there and refused if it is not empty; or the next free runs/NAME-NNN; whether made)."""
    try:
        if out is None:
            return next_run_dir(Path("runs"), name), True
        made = not out.exists()
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()):
            raise UsageError(f"--out: expected an empty or new directory, got {out}: it is not empty")
    except OSError as error:
        raise UsageError(f"run directory: cannot make {error.filename or out}: {error.strerror}") from None
    return out, made


def next_run_dir(parent: Path, name: str) -> Path:
    """Makes parent/NAME-NNN, the next free number. Raises OSError."""
    parent.mkdir(exist_ok=True)
    endings = [path.name[len(name) + 1 :] for path in parent.glob(f"{name}-*")]
    number = max((int(text) for text in endings if text.isascii() and text.isdigit()), default=0)
    while True:
        number += 1
        try:
            (parent / f"{name}-{number:03d}").mkdir()
        except FileExistsError:
            continue  # somebody else runs the same scenario
        return parent / f"{name}-{number:03d}"


# -- verdict -------------------------------------------------------------------------------------------------------


def _summary(scenario: Scenario, folder: Path, outcome: Outcome, report: SealReport) -> dict[str, Any]:
    run = open_run(folder)
    metrics = measure(run)
    ways = fates(report.fates)
    link = _link_counters(outcome.rig, metrics, sum(way["corrupted"] for way in ways.values()))
    metrics |= {"crc_errors": link["crc_errors"], "discarded_bytes": link["discarded_bytes"]}
    judgements = judge(scenario.require, metrics) if outcome.reason in ("finished", "diverged") else []
    timing = _timing(scenario, outcome, report)
    not_a_number = sum(event.code in (events.NAN, events.PLANT_NAN) for event in run.events)
    exit_code, verdict = _verdict(outcome, judgements, timing["degraded"], not_a_number)
    return {
        "verdict": verdict,
        "exit_code": exit_code,
        "failure": outcome.failure,
        "scenario": scenario.name,
        "board": scenario.board,
        "reason": outcome.reason,
        "ticks": outcome.ticks,
        "duration_s": outcome.ticks * scenario.period_ns * 1e-9,
        "metrics": as_json(metrics),
        "require": [plain(judgement._asdict()) for judgement in judgements],
        "not_a_number": not_a_number,
        "restarted_at_ticks": [event.tick for event in run.events if event.code == events.BOARD_RESTARTED],
        "link": link,
        "fates": ways,
        "timing": timing,
        "reproducible": not link["real_misses"] and not link["restarts"],
        "sha256": report.sha256,
        "law_file": _law_file(scenario),
        "run_dir": str(folder),
    }


def _verdict(outcome: Outcome, judgements: list[Judgement], degraded: bool, not_a_number: int) -> tuple[int, str]:
    """The first line of the table of exit codes that applies; NaN anywhere is a failure, asked for or not."""
    if outcome.reason == "interrupted":
        return EXIT_INTERRUPTED, "interrupted"
    if outcome.failure:
        return EXIT_LINK, "failed"
    if degraded:
        return EXIT_LINK, "degraded"
    expected = any(j.metric.startswith("diverged_at_s") for j in judgements)
    if not_a_number or not all(j.passed for j in judgements) or (outcome.reason == "diverged" and not expected):
        return EXIT_REQUIREMENT, "failed"
    return EXIT_OK, "passed"


def _link_counters(rig: Rig | None, metrics: Mapping[str, Any], corrupted: int) -> dict[str, int]:
    """From the log what is in the log: `corrupted` are frames that the modelled link altered, both ways.

    Real misses, CRC errors, discarded bytes and the rest belong to this host and its link, at the laboratory's end.
    """
    counters = rig.port.counters if rig is not None and rig.port is not None else None
    return {
        "missed": metrics["missed"],
        "late": metrics["late"],
        "real_misses": rig.window.real_misses if rig is not None and rig.window is not None else 0,
        "overruns": metrics["overruns"],
        "restarts": metrics["restarts"],
        "corrupted": corrupted,
        **{name: getattr(counters, name, 0) for name in PORT_COUNTERS},
        "strays": rig.answers.strays if rig is not None and rig.answers is not None else 0,
    }


def _timing(scenario: Scenario, outcome: Outcome, report: SealReport) -> dict[str, Any]:
    """The wall-clock side of a run; `degraded` by the scenario's limits, or because the machine was suspended."""
    simulated_s = outcome.ticks * scenario.period_ns * 1e-9
    rig, got = outcome.rig, outcome.granted
    loop = rig.loop if rig is not None else None
    wall_period_ns = scenario.period_ns / scenario.clock_scale if scenario.clock_scale else math.inf
    lateness_ns, caused = (loop.lateness_ns, loop.causes) if loop is not None else ((), ())
    wakes = lateness.of_run(lateness_ns, caused, wall_period_ns, scenario.timing.max_lateness_ms)
    too_many = wakes["late_fraction"] > scenario.timing.max_degraded_fraction
    return {
        "wall_s": outcome.wall_s,
        "start_s": outcome.start_s,
        "seal_s": report.wall_s,
        "times_real_time": simulated_s / outcome.wall_s if outcome.wall_s > 0 else 0.0,
        **wakes,
        "answer_us": lateness.percentiles_us(report.answers_ns),
        "degraded": too_many or outcome.suspended_s > 0,
        "rebased_ticks": loop.rebased_ticks if loop is not None else 0,
        "slipped_s": loop.slipped_ns * 1e-9 if loop is not None else 0.0,
        "suspended_s": outcome.suspended_s,
        "granted": got._asdict() if got is not None else None,
    }
