"""A finished run as numpy arrays by name: `run = open_run("runs/mrac-rs232-001"); run["phi_deg"]`.

Names and units: `help(sil.open_run)`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from protocol.law_tables import COMMON
from sil import mcap_file
from sil.reference import Start, model_of, recompute
from sil.run_columns import AXES, COLUMNS, PARTS, TRIPLES
from sil.run_file import RunError, check_sections, log_of, parsed, read, readable, rows_of
from sil.sinks import events as event_texts
from sil.sinks import layouts
from sil.sinks.journal import Fate

__all__ = ["Array", "EventRow", "PacketRow", "Run", "RunError", "open_run", "readable", "wrapped_deg"]

Array = npt.NDArray[Any]
_OPENED = ("/truth", "/command", "/telemetry", "/event", "/session")
_PACKETS = ("/packet/up", "/packet/down")
_REFERENCE_RESTART = 7
_RAD = np.pi / 180.0


class EventRow(NamedTuple):
    """One event; origin `board` or `laboratory`."""

    tick: int
    t_s: float  # s, simulation time
    code: int  # as in protocol/events.py
    origin: str  # board or laboratory
    a: int  # first number, meaning by code
    b: int  # second number
    text: str  # what happened, in words


class PacketRow(NamedTuple):
    """One deterministic frame of the log, in recorded order (tick, direction, type, sequence)."""

    tick: int  # the tick it is filed under; CONFIG: its session's first
    direction: str  # up (to the board) or down
    type: int  # of frame, as in SPEC.md
    sequence: int  # counts per direction, modulo 2^16
    fate: str  # delivered, late, dropped, corrupted, in_flight
    packet: bytes  # header to CRC
    encoded: bytes  # bytes on the wire where a byte fault altered them, else empty
    cause: str = ""  # why it was lost, altered or late: drop, burst, bit errors, ...; empty for logs of older versions
    copy: int = 0  # 0: the frame's own, 1: of a duplicate
    arrival_ns: int = -1  # modelled, on the simulation's clock, had it not been lost; -1: not modelled


class Run:
    """A run that was read back; names and units: `help(sil.open_run)`. `run[name]`, `run.names`, `run.units`.

    path: the MCAP file; directory: where it lies. meta: what decides the numbers (`period_ns`, `seed`, `versions`,
    ...). scenario: the resolved scenario, only what is run: no clock, link, board, out. end: {"reason", "ticks"}.
    summary: content of summary.json beside the log, {} without. sessions: ticks at which board sessions started.
    commands: all COMMAND rows as a structured array (sil.sinks.layouts.COMMAND).
    """

    def __init__(self, path: Path, content: mcap_file.Content) -> None:
        self.path = path
        self.directory = path.parent
        self.meta = parsed(content.metadata["run"])
        self.end = parsed(content.metadata.get("end", {"reason": "truncated", "ticks": "0"}))
        self.config_words = parsed(content.metadata.get("config", {}))
        self.scenario: dict[str, Any] = json.loads(content.attachments.get("scenario.json", b"{}"))
        check_sections(self.scenario)
        self.name = str(self.meta.get("name", path.parent.name))
        self.period_ns = int(self.meta["period_ns"])
        if self.period_ns <= 0:
            raise ValueError(f"period_ns: expected a number above 0, got {self.period_ns}")
        self.period_s = self.period_ns * 1e-9
        self.truth = rows_of(content.messages, "/truth", layouts.TRUTH)
        self.commands = rows_of(content.messages, "/command", layouts.COMMAND)
        self.sessions = [int(row["tick"]) for row in rows_of(content.messages, "/session", layouts.SESSION)]
        self._events = rows_of(content.messages, "/event", layouts.EVENT)
        self._columns = self._from_truth() | self._from_commands()
        self.telemetry, telemetry_units = self._from_telemetry(content)
        self._ahead = {topic: rows for topic, rows in content.messages.items() if topic not in _OPENED}
        self.units: dict[str, str] = COLUMNS | TRIPLES | telemetry_units

    # -- by name -------------------------------------------------------------------------------------------------

    @property
    def names(self) -> list[str]:
        """Everything that run[name] knows."""
        return list(self.units)

    def __getitem__(self, name: str) -> Array:
        if name in PARTS:
            whole, column = PARTS[name]
            return np.asarray(self[whole][:, column])
        if name in self._columns:
            return self._columns[name]
        if name in self.telemetry:
            return self.telemetry[name]
        if name in ("reference_deg", "error_deg", "setpoint_error_deg"):
            return np.asarray(getattr(self, f"_{name}"))
        raise KeyError(f"{name!r} is not in this run; known: {', '.join(self.names)}")

    def __len__(self) -> int:
        return len(self.truth)

    def __repr__(self) -> str:
        return f"<Run {self.name}: {len(self)} ticks of {self.period_s:g} s, {self.end.get('reason')}, {self.path}>"

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        from sil.run_table import table_of

        return table_of(self)

    @property
    def tick(self) -> Array:
        """(N,) tick numbers."""
        return self["tick"]

    @property
    def t_s(self) -> Array:
        """(N,) simulation time, s."""
        return self["t_s"]

    @property
    def attitude_deg(self) -> Array:
        """(N, 3) true attitude angles, deg."""
        return self["attitude_deg"]

    @property
    def reference_deg(self) -> Array:
        """(N, 3) recomputed reference, deg; NaN where there is none."""
        return self["reference_deg"]

    @property
    def error_deg(self) -> Array:
        """(N, 3) attitude - reference, deg."""
        return self["error_deg"]

    @property
    def setpoint_deg(self) -> Array:
        """(N, 3) set-point, deg."""
        return self["setpoint_deg"]

    @property
    def setpoint_error_deg(self) -> Array:
        """(N, 3) attitude - set-point, deg."""
        return self["setpoint_error_deg"]

    @property
    def command_Nm(self) -> Array:
        """(N, 3) torque computed at the tick, N m; NaN where no COMMAND came."""
        return self["command_Nm"]

    @property
    def applied_Nm(self) -> Array:
        """(N, 3) torque acting from the tick on, N m."""
        return self["applied_Nm"]

    @property
    def omega_radps(self) -> Array:
        """(N, 3) body rate omega_BN, body axes, rad/s."""
        return self["omega_radps"]

    @property
    def q_BN(self) -> Array:
        """(N, 4) attitude in inertial space, scalar first."""
        return self["q_BN"]

    @property
    def momentum_Nms(self) -> Array:
        """(N, 3) absolute wheel momentum, N m s."""
        return self["momentum_Nms"]

    # -- rows ----------------------------------------------------------------------------------------------------

    @cached_property
    def events(self) -> list[EventRow]:
        """All events in the order of the log."""
        with readable(self.path):
            return [
                EventRow(
                    int(tick), tick * self.period_s, int(code), ("laboratory", "board")[origin], int(a), int(b),
                    event_texts.describe(int(code), int(a), int(b))[1],
                )
                for tick, a, b, code, origin in self._events.tolist()
            ]  # fmt: skip

    @cached_property
    def packets(self) -> list[PacketRow]:
        """All deterministic frames in the order of the log (read when first asked for)."""
        messages = self._messages(_PACKETS)
        rows = []
        with readable(self.path):
            for direction in ("up", "down"):
                for message in messages[f"/packet/{direction}"]:
                    _, sequence, type_, fate, packet, encoded, cause, copy, at_ns = layouts.PACKET.unpack(message[1])
                    tick, named = message[0] // self.period_ns, Fate(fate).name.lower()
                    rows.append(PacketRow(tick, direction, type_, sequence, named, packet, encoded, cause, copy, at_ns))
        return sorted(rows, key=lambda row: row.tick)  # stable: up before down, then as written

    @cached_property
    def samples(self) -> Array:
        """All SAMPLE rows as a structured array (sil.sinks.layouts.SAMPLE; read when first asked for)."""
        with readable(self.path):
            return rows_of(self._messages(("/sample",)), "/sample", layouts.SAMPLE)

    @cached_property
    def summary(self) -> dict[str, Any]:
        """summary.json beside the log; {} where there is none or it is not JSON."""
        try:
            content = json.loads((self.directory / "summary.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return content if isinstance(content, dict) else {}

    def _messages(self, topics: tuple[str, ...]) -> Mapping[str, list[mcap_file.Message]]:
        """What was read ahead when the run was opened, if it has these topics; else the file once more."""
        return self._ahead if all(topic in self._ahead for topic in topics) else read(self.path, topics).messages

    # -- columns -------------------------------------------------------------------------------------------------

    def _from_truth(self) -> dict[str, Array]:
        truth = self.truth
        ticks = truth["tick"].astype(np.int64)
        return {
            "tick": ticks,
            "t_s": ticks * self.period_s if self.period_ns % 1_000_000 else ticks * (self.period_ns // 1_000_000) / 1e3,
            "attitude_deg": truth["euler_deg"],
            "setpoint_deg": truth["setpoint_deg"],
            "applied_Nm": truth["applied_nm"],
            "omega_radps": truth["omega_bn_b_radps"],
            "momentum_Nms": truth["momentum_nms"],
            "q_BN": _continuous(truth["q_bn"]),
        }

    def _from_commands(self) -> dict[str, Array]:
        came = ~np.isin(self.commands["fate"], (Fate.DROPPED, Fate.CORRUPTED))
        rows = self.commands[came]
        return {"command_Nm": self._aligned(rows["tick"], rows["torque_nm"])}

    def _from_telemetry(self, content: mcap_file.Content) -> tuple[dict[str, Array], dict[str, str]]:
        channel = content.channels.get("/telemetry")
        if channel is None:
            return {}, {}
        try:
            names = json.loads(channel.metadata["names"])
            units = json.loads(channel.metadata["units"])
        except (KeyError, ValueError) as error:
            raise RunError(f"{self.path}: /telemetry does not say what its words are ({error})") from error
        layout = layouts.telemetry(channel.metadata.get("law", ""), [(name, units[name]) for name in names])
        rows = rows_of(content.messages, "/telemetry", layout)
        columns = zip(names, layout.fields, strict=False)
        return {name: self._aligned(rows["tick"], rows[field.name]) for name, field in columns}, units

    def _aligned(self, ticks: Array, values: Array) -> Array:
        """Values by row: those of the row's tick, the first where there are several; NaN where there are none."""
        result = np.full((len(self.truth), *values.shape[1:]), np.nan)
        rows = np.searchsorted(self.truth["tick"], ticks)
        known = rows < len(result)
        known[known] &= self.truth["tick"][rows[known]] == ticks[known]
        result[rows[known][::-1]] = values[known][::-1]
        return result

    # -- reference -----------------------------------------------------------------------------------------------

    def reported(self, name: str) -> Array:
        """(N, 3) of a TELEMETRY triple such as `reference`, `reference_rate`, `setpoint`; NaN where there was none."""
        if f"{name}_x" not in self.telemetry:
            return np.full((len(self), 3), np.nan)
        return np.column_stack([self.telemetry[f"{name}_{axis}"] for axis in AXES])

    @property
    def reference_runs(self) -> Array:
        """(N,) bool: False from the first tick of a later board session to the first reading its board could use."""
        runs = np.ones(len(self), bool)
        starts = [row.tick for row in self.events if row.code == _REFERENCE_RESTART and row.origin == "board" and row.b]
        for session in self.sessions[1:]:
            begins = min((tick for tick in starts if tick >= session), default=np.inf)
            runs &= (self.tick < session) | (self.tick >= begins)
        return runs

    @cached_property
    def _reference_deg(self) -> Array:
        with readable(self.path):
            return self._recomputed_deg()

    def _recomputed_deg(self) -> Array:
        words = self.config_words
        if not all(word.name in words for word in COMMON):
            return np.full((len(self), 3), np.nan)
        first = int(self.truth["tick"][0]) if len(self) else 0
        starts = sorted({
            (int(row["tick"]) - first, bool(row["b"]))
            for row in self._events
            if row["code"] == _REFERENCE_RESTART and row["origin"] == 1 and int(row["tick"]) >= first
        })  # fmt: skip
        reported, rate = self.reported("reference") * _RAD, self.reported("reference_rate") * _RAD
        made = recompute(model_of(words), self._guided_deg() * _RAD, reported, rate, [Start(*s) for s in starts])
        return np.asarray(made / _RAD)

    def _guided_deg(self) -> Array:
        """The set-point the board had: the laboratory's; where it comes by SAMPLE, the one TELEMETRY says arrived."""
        ours = self["setpoint_deg"]
        arrived = self.reported("setpoint")
        if not self.config_words.get("setpoint_source"):
            return ours
        return np.where(np.isfinite(arrived), arrived, ours)

    @cached_property
    def _error_deg(self) -> Array:
        return wrapped_deg(self["attitude_deg"] - self["reference_deg"])

    @cached_property
    def _setpoint_error_deg(self) -> Array:
        return wrapped_deg(self["attitude_deg"] - self["setpoint_deg"])


def open_run(path: str | os.PathLike[str], also: tuple[str, ...] = ()) -> Run:
    """Read a run: a run directory or an .mcap file; names and units: `help(sil.open_run)`. Every CRC is checked.

    also: topics that will be asked for (`/sample` for samples, `/packet/up` and `/packet/down` for packets): a long log
    is then read once. Raises RunError, one line: no such run, not sealed yet, empty, cut off, corrupt, not MCAP,
    somebody else's MCAP.
    """
    file = Path(path)
    if file.is_dir():
        file = log_of(file)
    content = read(file, (*_OPENED, *also))
    if "run" not in content.metadata or "/truth" not in content.channels:
        raise RunError(f"{file}: an MCAP log (of {content.library or 'unknown origin'}), but not one of a run")
    with readable(file):
        return Run(file, content)


def wrapped_deg(angle: Array) -> Array:
    """Modulo 360 deg, in [-180, 180]; unchanged where it is there already."""
    return np.where(np.abs(angle) <= 180.0, angle, angle - 360.0 * np.floor(angle / 360.0 + 0.5))


def _continuous(q: Array) -> Array:
    """The same rotations with signs such that neighbours have a positive scalar product."""
    if len(q) < 2:
        return q
    flips = np.where((q[1:] * q[:-1]).sum(axis=1) < 0, -1.0, 1.0)
    signs = np.concatenate(([1.0], np.cumprod(flips)))
    return q if (signs > 0).all() else q * signs[:, None]
