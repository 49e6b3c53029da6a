"""Frames to decoded rows: wire integers become numbers in SI units or degrees, scaled by the CONFIG that was sent.

Angles: deg = bam * 360 / 2^32, exact in float64. Torque, momentum and rate: int32 * 2^-bits, exact too; the bits come
from the CONFIG frames of the same log (COMMON's defaults until they have been seen).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from protocol import law_tables
from protocol.frames import Command, Config, Reading, Sample, Telemetry
from protocol.law_tables import COMMON, LAWS, REFERENCE_NONE, TELEMETRY_COMMON, Word
from sil.sinks import layouts

DEG_PER_BAM = 360.0 / 2**32
_NAN3 = (float("nan"),) * 3
_NAN4 = (float("nan"),) * 4
_NO_AGE = 0xFFFFFFFF
_BITS = ("torque_bits", "momentum_bits", "rate_bits")
_NAMES = [word.name for word in COMMON]
_BITS_AT = {name: _NAMES.index(name) for name in _BITS}
_REFERENCE_AT = [_NAMES.index(name) for name in ("reference_kind", "rate_limit", "telemetry_every")]


class TelemetryTable(NamedTuple):
    """How the TELEMETRY of one law is written: (name, unit) and value of one count per word."""

    law: str
    layout: layouts.Layout
    words: tuple[tuple[str, str], ...]
    scales: tuple[float, ...]

    def pack(self, frame: Telemetry, fate: int) -> bytes:
        """The /telemetry row; words that the frame does not have are NaN."""
        values = [count * scale for count, scale in zip(frame.words, self.scales, strict=False)]
        values += [float("nan")] * (len(self.scales) - len(values))
        return self.layout.pack(*values, frame.tick, frame.law_id, frame.law_version, fate)


class Decoder:
    """Decodes the frames of one run in log order."""

    def __init__(self) -> None:
        self.words: dict[int, int] = {}
        self.follows_setpoint = False  # the board has no reference model that differs from the set-point
        self.tells_reference = False  # it has that, or reports its reference in TELEMETRY
        self._law = ""
        self._table: TelemetryTable | None = None
        self._take_bits()

    def describe(self, meta: Mapping[str, Any]) -> None:
        """Take the law's name from META (`law: {name: ...}` or `law: name`), for laws that no table names."""
        law = meta.get("law", "")
        self._law = str(law.get("name", "") if isinstance(law, Mapping) else law)

    def config(self, frame: Config) -> None:
        """One part of CONFIG."""
        self.words.update(enumerate(frame.words, frame.offset))
        self._take_bits()
        kind, limit, every = (self.words.get(index) for index in _REFERENCE_AT)
        self.follows_setpoint = (kind, limit) == (REFERENCE_NONE, 0)
        self.tells_reference = self.follows_setpoint or bool(every)

    def named_words(self) -> dict[str, int | list[int]]:
        """COMMON's words by name, and all words in order under `words`."""
        named: dict[str, int | list[int]] = {
            word.name: self.words[i] for i, word in enumerate(COMMON) if i in self.words
        }
        named["words"] = [self.words[i] for i in sorted(self.words)]
        return named

    def command(self, frame: Command, fate: int) -> bytes:
        """The /command row."""
        tick, (x, y, z), flags, follows, used = frame
        s = self._torque
        return layouts.COMMAND.pack(x * s, y * s, z * s, tick, x, y, z, flags, used, follows, fate)

    def sample(self, frame: Sample, fate: int) -> bytes:
        """The /sample row."""
        euler, quaternion, rate = frame.readings
        ages = [_NO_AGE if reading is None else reading.age_us for reading in frame.readings]
        present = sum(1 << bit for bit, reading in enumerate(frame.readings) if reading is not None)
        return layouts.SAMPLE.pack(
            *_times(frame.setpoint, DEG_PER_BAM),
            *_times(frame.applied, self._torque),
            *_times(frame.momentum, self._momentum),
            *_values(euler, DEG_PER_BAM, _NAN3),
            *_values(quaternion, 2.0**-30, _NAN4),
            *_values(rate, self._rate, _NAN3),
            frame.tick,
            frame.ack,
            frame.transit_us,
            *ages,
            frame.source,
            present,
            frame.valid,
            fate,
        )

    def telemetry_table(self, frame: Telemetry) -> TelemetryTable:
        """The table of the run's law; made from the first TELEMETRY frame."""
        if self._table is None:
            known = LAWS.get((frame.law_id, frame.law_version))
            words = [*TELEMETRY_COMMON, *(known.telemetry if known else ())]
            extra = range(len(words), len(frame.words))
            words += [Word(f"word_{i}", "", 0, 0, 0, 0, "no table names it") for i in extra]
            law = known.name if known else self._law or f"law_{frame.law_id}"
            units = tuple(_name_unit(word) for word in words)
            scales = tuple(self._scale(word) for word in words)
            layout = layouts.telemetry(law, units, [word.about for word in words])
            self._table = TelemetryTable(law, layout, units, scales)
        return self._table

    def _scale(self, word: Word) -> float:
        """Value of one count, in the unit of _name_unit."""
        return turns_of(word) * law_tables.lsb_of(word, self._named())

    def _named(self) -> dict[str, int]:
        return {word.name: self.words.get(i, int(word.default)) for i, word in _plain()}

    def _take_bits(self) -> None:
        words = self.words
        bits = [words.get(_BITS_AT[name], int(COMMON[_BITS_AT[name]].default)) for name in _BITS]
        self._torque, self._momentum, self._rate = (2.0**-n for n in bits)


def turns_of(word: Word) -> float:
    """deg in the unit of a word that counts turns; 1 for other units."""
    turn = {"2^-32 turn": DEG_PER_BAM, "turn": 360.0}
    return next((value for prefix, value in turn.items() if word.unit.startswith(prefix)), 1.0)


def _plain() -> list[tuple[int, Word]]:
    """The words of COMMON that can name a number of bits."""
    return [(i, word) for i, word in enumerate(COMMON) if word.name.endswith("_bits")]


def _name_unit(word: Word) -> tuple[str, str]:
    """The word's name and the unit it is decoded to: turns become degrees."""
    return word.name, word.unit.replace("2^-32 turn", "deg").replace("turn", "deg")


def _times(values: tuple[int, ...], scale: float) -> tuple[float, ...]:
    x, y, z = values
    return x * scale, y * scale, z * scale


def _values(reading: Reading | None, scale: float, absent: tuple[float, ...]) -> tuple[float, ...]:
    return absent if reading is None else tuple(value * scale for value in reading.values)
