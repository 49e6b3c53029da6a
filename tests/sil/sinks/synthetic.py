"""A script-generated run: real frames around a toy loop, journalled as the laboratory does, without loop or board.

Three decoupled double integrators, a PD law computed here, the zoh reference, one tick of transport delay. COMMAND(k)
is journalled in the commit of tick k+1, as in a paced run.
"""

from __future__ import annotations

import math
from pathlib import Path

from protocol import config, events, frames
from protocol.frames import NO_TICK, Command, Event, Reading, Sample, Telemetry
from protocol.law_tables import config_words
from protocol.laws.pd import PD
from sil.sinks import journal as jn
from sil.sinks.journal import Direction, Fate, Journal, Kind

PERIOD_NS = 500_000_000
PERIOD_S = 0.5
INERTIA = (2.13, 3.04, 3.09)
WHEEL_INERTIA = [0.002, 0.003, 0.0]  # of the third one only the momentum is known
START_DEG = (10.0, 10.0, 5.0)
TURN = 2.0 * math.pi
BAM_RAD = TURN / 2**32
TORQUE_LSB, MOMENTUM_LSB = 2.0**-30, 2.0**-28
POLE = round(math.exp(-0.075) * 2**30) / 2**30
STEP_DEG = (25.0, -30.0, 0.0)
RESTART_TICK = 0


def bam(radians: float) -> int:
    """Radians to wire units."""
    return (round(radians / BAM_RAD) + 2**31) % 2**32 - 2**31


def setpoint(tick: int, ticks: int) -> tuple[int, int, int]:
    """A step in roll at a tenth of the run, in pitch at a fifth of it."""
    x, y, z = STEP_DEG
    return bam(math.radians(x if tick >= ticks // 10 else 0)), bam(math.radians(y if tick >= ticks // 5 else 0)), bam(z)


def meta(ticks: int) -> dict[str, object]:
    """META of the synthetic run."""
    scenario = {
        "name": "synthetic",
        "seed": 1,
        "duration_s": ticks * PERIOD_S,
        "period_s": PERIOD_S,
        "transport_delay_ticks": 1,
        "law": {"name": "pd"},
        "attitude": {"sequence": 321, "frame": "lvlh"},
        "actuators": {"kind": "wheels", "wheels": {"inertia_kgm2": WHEEL_INERTIA}},
        "metrics": {"from_tick": 20},
        "require": [{"metric": "rms_error_deg.roll", "below": 30.0}],
    }
    return {
        "name": "synthetic",
        "period_ns": PERIOD_NS,
        "seed": 1,
        "law": {"name": "pd", "form": "float"},
        "versions": {"sil": "0.1.0"},
        "hashes": {"layout": f"{frames.LAYOUT_HASH:08x}"},
        "scenario": scenario,
    }


class Script:
    """The toy loop; `lose` ticks have no COMMAND, `late` ones have fate late, `telemetry_every` as in CONFIG."""

    def __init__(
        self,
        journal: Journal,
        ticks: int,
        lose: tuple[int, ...] = (),
        late: tuple[int, ...] = (),
        telemetry_every: int = 1,
        alter: dict[int, int] | None = None,
    ) -> None:
        self.journal, self.ticks, self.lose, self.late = journal, ticks, lose, late
        self.every, self.alter = telemetry_every, alter or {}
        self.y = [math.radians(a) for a in START_DEG]
        self.w = [0.0] * 3
        self.h = [0.0] * 3
        self.ref = [bam(y) * BAM_RAD for y in self.y]  # the first reading
        self.rate = [0.0] * 3
        self.accel = [0.0] * 3
        self.u = (0, 0, 0)
        self.acting: tuple[tuple[int, int, int], int, int] = ((0, 0, 0), frames.ZERO, NO_TICK)
        self.up = self.down = 0

    def run(self, end: bool = True, kill_at: int | None = None) -> None:
        """All ticks; without END when killed."""
        self.start()
        answer: list[bytes] = []
        for k in range(self.ticks):
            if k == kill_at:
                return
            self.record_answer(k - 1, answer)
            answer = self.tick(k)
            self.journal.commit(k)
        self.record_answer(self.ticks - 1, answer)
        if end:
            self.journal.add(Kind.END, self.ticks, jn.json_payload({"reason": "finished", "ticks": self.ticks}))
        self.journal.commit(self.ticks)

    def start(self) -> None:
        self.journal.add(Kind.META, 0, jn.json_payload(meta(self.ticks)))
        self.journal.add(Kind.HOST, 0, jn.json_payload({"link": "pty", "clock": "lockstep", "python": "3"}))
        self.journal.add(Kind.SESSION, 0, jn.json_payload({"tick": 0}))
        values = {"form": "float", "telemetry_every": self.every, "reference_pole": POLE, "setpoint_source": "sample"}
        for part in config.split(config_words(PD, values)):
            self.packet(0, Direction.UP, Fate.DELIVERED, self.sent(part))
        self.journal.commit(0)

    def tick(self, k: int) -> list[bytes]:
        if self.journal is None:
            return []
        r = setpoint(k, self.ticks)
        self.truth_and_sample(k, r)
        answer = self.answer(k, r)
        self.integrate(k, r)
        self.journal.add(Kind.TIMING, k, jn.timing_payload(1000 + k, 50_000))
        return answer

    def truth_and_sample(self, k: int, r: tuple[int, int, int]) -> None:
        torque, source, ack = self.acting
        q = (1.0, self.y[0] / 2, self.y[1] / 2, self.y[2] / 2)
        norm = math.sqrt(sum(c * c for c in q))
        applied = [n * TORQUE_LSB for n in torque]
        payload = jn.truth_payload([c / norm for c in q], self.w, self.h, self.y, applied, r, source)
        self.journal.add(Kind.TRUTH, k, payload)
        momentum = tuple(round(h / MOMENTUM_LSB) for h in self.h)
        euler = Reading(0, tuple(bam(y) for y in self.y))
        sample = Sample(k, r, torque, momentum, ack, 0, source, 1, (euler, None, None))  # type: ignore[arg-type]
        self.packet(k, Direction.UP, Fate.DELIVERED, self.sent(sample))

    def answer(self, k: int, r: tuple[int, int, int]) -> list[bytes]:
        followers: list[Telemetry | Event] = []
        if k % self.every == 0:
            words = (*map(bam, self.ref), *map(bam, self.rate), *r, 0, 0, 0, 0)
            error = tuple(bam(m - y) for m, y in zip(self.ref, self.y, strict=True))
            followers.append(Telemetry(k, PD.law_id, PD.version, (*words, *error)))
        if k == RESTART_TICK:
            followers.append(Event(k, events.REFERENCE_RESTART, 7, 1))
        gains = ((0.25 * i, 0.9 * i) for i in INERTIA)
        torque = tuple(
            round((kp * (m - y) + kd * (v / PERIOD_S - w)) / TORQUE_LSB) + self.alter.get(k, 0)
            for (kp, kd), m, y, v, w in zip(gains, self.ref, self.y, self.rate, self.w, strict=True)
        )
        frames_down = [Command(k, torque, 0, len(followers), frames.USED), *followers]  # type: ignore[arg-type]
        return [self.received(frame) for frame in frames_down]

    def record_answer(self, k: int, answer: list[bytes]) -> None:
        if not answer or k in self.lose:
            return
        fate = Fate.LATE if k in self.late else Fate.DELIVERED
        for packet in reversed(answer):  # arrival order must not matter
            self.packet(k, Direction.DOWN, fate, packet)
        if fate == Fate.LATE:
            self.journal.add(Kind.LAB_EVENT, k, jn.event_payload(events.COMMAND_LATE, k, 1234))

    def integrate(self, k: int, r: tuple[int, int, int]) -> None:
        torque, _, _ = self.acting
        for i in range(3):
            accel = torque[i] * TORQUE_LSB / INERTIA[i]
            self.y[i] += self.w[i] * PERIOD_S + accel * PERIOD_S**2 / 2
            self.w[i] += accel * PERIOD_S
            self.h[i] -= torque[i] * TORQUE_LSB * PERIOD_S
        self.advance(k, r)
        if k not in self.lose and k not in self.late:
            self.acting = (self.next_torque, frames.FRESH, k)
        elif self.acting[1] != frames.ZERO:
            self.acting = (self.acting[0], frames.HELD, self.acting[2])

    def advance(self, k: int, r: tuple[int, int, int]) -> None:
        """zoh reference, lead 2: what r(k) decides acts between k+1 and k+2; at its start ym(1) = ym(0)."""
        k1, k2 = (1 - POLE) ** 2, (1 - POLE) * (3 + POLE) / 2
        for i in range(3):
            if k == RESTART_TICK:
                error = r[i] * BAM_RAD - self.ref[i]
                self.rate[i] = 2 * ((1 - POLE) / (1 + POLE)) ** 2 * error
                self.accel[i] = k1 * error - k2 * self.rate[i]
                continue
            a = self.accel[i]
            self.ref[i] += self.rate[i] + a / 2
            self.rate[i] += a
            self.accel[i] = k1 * (r[i] * BAM_RAD - self.ref[i]) - k2 * self.rate[i]

    # -- frames --------------------------------------------------------------------------------------------------

    def sent(self, frame: frames.Frame) -> bytes:
        packet = frames.pack(frame, self.up)
        self.up = (self.up + 1) % 65536
        return packet

    def received(self, frame: frames.Frame) -> bytes:
        packet = frames.pack(frame, self.down)
        self.down = (self.down + 1) % 65536
        if isinstance(frame, Command):
            self.next_torque = frame.torque
        return packet

    def packet(self, tick: int, direction: Direction, fate: Fate, packet: bytes) -> None:
        self.journal.add(Kind.PACKET, tick, jn.packet_payload(direction, fate, packet))


def synthetic_journal(folder: Path, ticks: int = 200, **options: object) -> Path:
    """Write folder/run.journal; options as in Script and its run."""
    folder.mkdir(parents=True, exist_ok=True)
    run_options = {name: options.pop(name) for name in ("end", "kill_at") if name in options}
    journal = Journal(folder / "run.journal")
    Script(journal, ticks, **options).run(**run_options)  # type: ignore[arg-type]
    journal.close()
    return folder
