"""One configured session on the board: what happens in one tick, from reading to COMMAND, TELEMETRY and EVENTs.

Order within a tick: set-point -> what acts now -> reading -> reference model -> law -> limits and watchdog -> answer.
All times are counted in simulated nanoseconds from tick numbers, so every clock gives the same bytes.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np

from firmware_sim import controllers
from firmware_sim.controllers import inputs
from firmware_sim.guidance.reference import Reference
from protocol import events, frames
from protocol.frames import Command, Event, Sample, Telemetry
from protocol.law_tables import FORM_FLOAT, STALE_REUSE, Configuration, LawTable, parse_configuration, refusal

INT32_MAX = 2**31 - 1
EVENTS_PER_ANSWER = 16  # further ones are only counted


class FlightRefused(Exception):
    """The law will not fly with this configuration; the sentence says why."""


class Flight:
    """The configured board. `words`: CONFIG. Raises ConfigError (with the bad word's index) or FlightRefused."""

    def __init__(self, words: Sequence[int], user_law: tuple[LawTable, type] | None = None) -> None:
        configuration = parse_configuration(words, user_law[0] if user_law else None)
        self.table_hash = configuration.hash
        self._configuration = configuration
        self._table = configuration.table
        self._user_class = user_law[1] if user_law else None
        common = configuration.common
        self.period_ns = common["period_us"] * 1000
        self.sample_timeout_ns = common["sample_timeout_us"] * 1000
        self._answer_delay_ns = common["answer_delay_us"] * 1000
        self._delay = common["transport_delay_ticks"]
        self._link_limit = common["link_limit"]
        self._telemetry_every = common["telemetry_every"]
        self._needs = common["readings_mask"]
        self._float = common["form"] == FORM_FLOAT
        self._setpoint_from_sample = common["setpoint_source"] == 1
        self._reuse = common["stale"] == STALE_REUSE
        self._rows = configuration.rows
        self._si = inputs.si_scale(common)
        self._torque_unit = 2.0 ** -common["torque_bits"]
        self._limits = tuple(common[f"torque_limit_{axis}"] for axis in "xyz")
        reason = refusal(configuration)
        if reason is not None:
            raise FlightRefused(reason)
        self._free_at_ns = 0
        self._lost = self._overruns = self._dropped = self._saturations = 0
        self._pending: list[Event] = []
        self._begin()
        self._warm_up()

    def _new_law(self, configuration: Configuration) -> controllers.Law:
        if self._user_class is not None:
            return controllers.user_law(self._user_class, configuration)
        return controllers.new_law(self._table.name, configuration)

    def _warm_up(self) -> None:
        """Compile on copies: the next SAMPLE is answered in time, and the flight state is untouched."""
        inp = self._inp.copy()
        inp[inputs.FRESH] = 1
        reference = copy.deepcopy(self._reference)
        reference.advance(inp)
        reference.words()
        self._law.warm_up(inp, self._reference.state, self._out)

    def _begin(self) -> None:
        """Fresh law, reference and watchdog; what a start and a bumpless re-start have in common."""
        common = self._configuration.common
        try:
            self._law = self._new_law(self._configuration)
        except controllers.LawRefuses as error:
            raise FlightRefused(str(error)) from None
        self._reference = Reference(common, self._float)
        dtype = np.float64 if self._float else np.int64
        self._inp = np.zeros(inputs.SIZE, dtype)
        self._wire = [0] * inputs.SIZE
        self._words = np.zeros(inputs.SIZE, np.int64)
        self._out = np.zeros(4, dtype)
        self._sent: list[tuple[int, int, int]] = [(0, 0, 0)] * (self._delay + 1)  # newest last
        self._row = 0
        self._setpoint = (0, 0, 0)
        self._good_run = 0
        self._has_reading = self._reused = False
        self._since_sample = 0
        self._watchdog = False
        self._arithmetic = False

    # -- what the main loop calls --------------------------------------------------------------------------------

    def count_dropped(self, tick: int) -> None:
        """A SAMPLE for a tick that was already stepped."""
        self._dropped += 1
        if len(self._pending) < EVENTS_PER_ANSWER:
            self._pending.append(Event(tick, events.STALE_SAMPLE, _word(tick), self._dropped))

    def restart(self, expected: int, tick: int) -> None:
        """Bumpless re-start: the gap is too long to propagate; law and reference begin anew at the next reading.

        Counters, the model of busy time and events that wait for the next answer stay.
        """
        self._begin()
        self._restarted = True
        restarted = Event(tick, events.RESTARTED, _word(expected), _word(tick))
        self._pending.insert(0, restarted)  # first: never one too many

    _restarted = False

    def step(self, tick: int, sample: Sample | None) -> list[Command | Telemetry | Event]:
        """One tick, exactly once. Returns the answer: COMMAND, TELEMETRY if due, EVENTs, in wire order."""
        notices = [event._replace(tick=tick) for event in self._pending]
        self._pending = []
        usable, overrun = self._admit(tick, sample)
        self._take_setpoint(tick, sample)
        self._fill(tick, sample if usable else None)
        torque, flags = self._control(tick, notices)
        flags |= self._watch(tick, sample is not None, notices)
        if flags & frames.FLAG_WATCHDOG:
            torque = (0, 0, 0)
        if overrun:
            flags |= frames.FLAG_OVERRUN
            notices.append(Event(tick, events.OVERRUN, _word(tick), self._overruns))
        elif sample is not None and not usable:
            notices.append(Event(tick, events.READING_INVALID, self._needs, sample.valid))
        if not usable:
            notices.append(Event(tick, events.SAMPLE_LOST, _word(tick), self._lost))
        self._sent = [*self._sent[1:], torque]
        return self._answer(tick, torque, flags, usable, notices)

    # -- one tick, in order --------------------------------------------------------------------------------------

    def _admit(self, tick: int, sample: Sample | None) -> tuple[bool, bool]:
        """Execution model and validity: (the sample is used, it was an overrun).

        start = max(arrival, free_at); free_at = start + answer_delay; a SAMPLE that arrives before free_at finds the
        one-deep mailbox taken. Where CONFIG says `stale: reuse`, the last reading passes for this tick's instead.
        """
        start_ns = tick * self.period_ns
        start_ns += self.sample_timeout_ns if sample is None else sample.transit_us * 1000
        overrun = sample is not None and start_ns < self._free_at_ns
        self._free_at_ns = max(start_ns, self._free_at_ns) + self._answer_delay_ns
        usable = sample is not None and not overrun and (sample.valid & self._needs) == self._needs
        self._reused = self._reuse and self._has_reading and not usable
        self._has_reading |= usable
        self._good_run = self._good_run + 1 if usable or self._reused else 0
        self._lost += not usable
        self._overruns += overrun
        return usable, overrun

    def _take_setpoint(self, tick: int, sample: Sample | None) -> None:
        """The table's row that holds at `tick`; or, when CONFIG says so, SAMPLE's set-point, kept while none comes."""
        if self._setpoint_from_sample:
            if sample is not None:
                self._setpoint = sample.setpoint
            return
        while self._row < len(self._rows) and self._rows[self._row][0] <= tick:
            self._setpoint = self._rows[self._row][1:]
            self._row += 1

    def _fill(self, tick: int, sample: Sample | None) -> None:
        """The law's inputs in wire units; what acts now is the lab's word, without it the board's own COMMAND(k - n).

        Of that the law knows what it computed, but not that the watchdog sent zero instead: then it is told.
        Readings and momentum stay as they were while no sample comes.
        """
        wire = self._wire
        wire[inputs.FRESH] = int(sample is not None or self._reused)
        wire[inputs.GOOD_RUN] = self._good_run
        wire[inputs.APPLIED_KNOWN] = int(sample is not None or self._watchdog)
        wire[inputs.TICK] = tick
        wire[inputs.SETPOINT] = self._setpoint
        if sample is None:
            wire[inputs.APPLIED] = self._sent[-self._delay] if self._delay else self._sent[-1]
        else:
            wire[inputs.APPLIED] = sample.applied
            wire[inputs.MOMENTUM] = sample.momentum
            for place, reading in zip(inputs.READINGS, sample.readings, strict=True):
                if reading is not None:
                    wire[place] = reading.values
        self._words[:] = wire
        if self._float:
            np.multiply(self._words, self._si, out=self._inp)
        else:
            self._inp[:] = self._words

    def _control(self, tick: int, notices: list[Event]) -> tuple[tuple[int, int, int], int]:
        """Reference model, then law, then the wire's own limits."""
        restarted = self._reference.advance(self._inp)
        self._law.step(self._inp, self._reference.state, self._out)
        if restarted or self._law.reference_restarted:
            notices.append(Event(tick, events.REFERENCE_RESTART, 7, int(restarted)))
        flags = int(self._out[3])
        arithmetic = bool(flags & frames.FLAG_ARITHMETIC)
        if arithmetic and not self._arithmetic:
            notices.append(Event(tick, events.ARITHMETIC_SATURATION, _word(tick), 0))
        self._arithmetic = arithmetic
        torque = self._to_wire(notices, tick)
        limited = tuple(max(-m, min(m, u)) for u, m in zip(torque, self._limits, strict=True))
        if limited != torque:
            flags |= frames.FLAG_SATURATED
        self._saturations += bool(flags & frames.FLAG_SATURATED)
        return limited, flags  # type: ignore[return-value]

    def _to_wire(self, notices: list[Event], tick: int) -> tuple[int, ...]:
        """The law's torque in the wire's LSB; 0 where it is not a number."""
        values = self._out[:3].tolist()
        for axis, u in enumerate(values):
            if u != u or u == inputs.NOT_A_NUMBER:
                notices.append(Event(tick, events.NAN, axis, 0))
                values[axis] = 0
        if self._float:
            return tuple(round(max(-INT32_MAX, min(INT32_MAX, u / self._torque_unit))) for u in values)
        return tuple(values)

    def _watch(self, tick: int, heard: bool, notices: list[Event]) -> int:
        """Link watchdog: after link_limit ticks without a SAMPLE the command is zero, until the next SAMPLE."""
        self._since_sample = 0 if heard else self._since_sample + 1
        tripped = self._since_sample >= self._link_limit
        if tripped != self._watchdog:
            code = events.WATCHDOG_ON if tripped else events.WATCHDOG_OFF
            notices.append(Event(tick, code, _word(tick), self._since_sample))
            self._watchdog = tripped
        return frames.FLAG_WATCHDOG if tripped else 0

    def _answer(
        self, tick: int, torque: tuple[int, int, int], flags: int, usable: bool, notices: list[Event]
    ) -> list[Command | Telemetry | Event]:
        used = frames.USED if usable else frames.PROPAGATED if self._law.has_model else frames.REPEATED
        if self._reused:
            used = frames.REUSED
        if self._restarted:
            used, self._restarted = frames.RESTARTED, False
        notices = notices[:EVENTS_PER_ANSWER]
        due = self._telemetry_every > 0 and tick % self._telemetry_every == 0
        answer: list[Command | Telemetry | Event] = [Command(tick, torque, flags, due + len(notices), used)]
        if due:
            answer.append(Telemetry(tick, self._table.law_id, self._table.version, self._telemetry()))
        return answer + notices

    def _telemetry(self) -> tuple[int, ...]:
        counters = (self._lost, self._overruns, self._dropped, self._saturations)
        return (*self._reference.words(), *self._setpoint, *counters, *self._law.telemetry())


def _word(tick: int) -> int:
    """A tick number as an event carries it: modulo 2^31."""
    return tick & INT32_MAX
