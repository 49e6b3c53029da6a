"""What the words of CONFIG and TELEMETRY mean: one table for all laws and one per (law id, version), in laws/.

CONFIG words = COMMON, then the law's params, then `guidance_rows` rows of four words (tick, x, y, z; set-point in
2^-32 turn, zero before the first row). TELEMETRY words = TELEMETRY_COMMON, then the law's. All words are int32.
A word holds round(value * 2^q); q is a number or the name of the word that holds it.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

from protocol import laws
from protocol.law_words import (
    AUTOMATIC,
    AXES,
    FORM_FIXED,
    FORM_FLOAT,
    READ_EULER,
    REFERENCE_NONE,
    REFERENCE_PAPER,
    REFERENCE_ZOH,
    SEQUENCE_321,
    STALE_REUSE,
    USER_LAW_ID,
    LawTable,
    Variant,
    vector,
)
from protocol.words import (
    INT32_MAX,
    NO_LIMIT,
    STATUS_MISSING,
    STATUS_UNKNOWN_LAW,
    ConfigError,
    Word,
    dequantise,
    in_range,
    lsb_of,
    number_of,
    quantise,
    range_text,
)

# What belongs to a single word or to the table of one law is read from here too.
__all__ = [
    "AUTOMATIC",
    "AXES",
    "FORM_FLOAT",
    "INT32_MAX",
    "NO_LIMIT",
    "REFERENCE_NONE",
    "REFERENCE_PAPER",
    "REFERENCE_ZOH",
    "STALE_REUSE",
    "USER_LAW_ID",
    "ConfigError",
    "LawTable",
    "Variant",
    "Word",
    "dequantise",
    "lsb_of",
    "quantise",
]

COMMON: tuple[Word, ...] = (
    Word("law_id", "", 0, 1, USER_LAW_ID, 1, "selects, with law_version, the table of this law"),
    Word("law_version", "", 0, 0, 65535, 1, "version of the law's table"),
    Word("form", "", 0, 0, 1, 0, "arithmetic of the law", ("fixed", "float")),
    Word("period_us", "us", 0, 1000, 60_000_000, 500_000, "sampling period T_s"),
    Word("transport_delay_ticks", "tick", 0, 0, 4, 1, "n: COMMAND(k) acts from t_(k+n) on"),
    Word("hold_limit", "tick", 0, 0, 1_000_000, 10, "misses in a row that hold the last torque; then zero"),
    Word("link_limit", "tick", 0, 1, 1_000_000, 20, "ticks without a SAMPLE until COMMAND is zero"),
    Word("sample_timeout_us", "us", 0, 0, 60_000_000, 100_000, "a SAMPLE later than this counts as lost"),
    Word("answer_delay_us", "us", 0, 0, 60_000_000, 0, "execution model: time the board is busy with one step"),
    Word("telemetry_every", "tick", 0, 0, 1_000_000, 1, "TELEMETRY(k) where k is a multiple of this; 0: never"),
    Word("torque_bits", "", 0, 8, 30, 30, "LSB of a torque is 2^-torque_bits N m"),
    Word("momentum_bits", "", 0, 8, 30, 28, "LSB of a momentum is 2^-momentum_bits N m s"),
    Word("rate_bits", "", 0, 8, 30, 28, "LSB of a rate is 2^-rate_bits rad/s"),
    Word("readings_mask", "", 0, 0, 7, 1, "readings the law needs: 1 euler, 2 quaternion, 4 rate"),
    *vector("torque_limit", "N m", "torque_bits", 0, math.inf, (math.inf,) * 3, "torque limit (2147483647: none)"),
    Word("reference_kind", "", 0, 0, 2, 1, "reference model", ("none", "zoh", "paper")),
    Word("reference_lead", "tick", 0, 1, 2, 2, "d: the set-point of tick k first shows in the reference of k + d"),
    Word("reference_pole", "", 30, 0, 1, math.exp(-0.075), "p = exp(-wn T_s), double pole of the reference model"),
    Word("rate_limit", "2^-32 turn/sample", 0, 0, INT32_MAX, 0, "limit of the reference's rate, 0: none"),
    Word("accel_limit", "2^-32 turn/sample^2", 0, 0, INT32_MAX, 0, "limit of the reference's acceleration, 0: none"),
    Word("setpoint_source", "", 0, 0, 1, 0, "where the set-point comes from", ("table", "sample")),
    Word("guidance_rows", "", 0, 0, 4096, 0, "number of guidance rows after the law's parameters"),
    Word("stale", "", 0, 0, 1, 0, "without a usable SAMPLE", ("propagate", "reuse")),
    Word("attitude_sequence", "", 0, 0, 1, 0, "of all Euler angles: yaw first, or roll first", ("321", "123")),
)

ROW_WORDS = 4  # tick, x, y, z

TELEMETRY_COMMON: tuple[Word, ...] = (
    *vector("reference", "2^-32 turn", 0, -(2**31), INT32_MAX, (0, 0, 0), "reference ym(k)"),
    *vector("reference_rate", "2^-32 turn/sample", 0, -(2**31), INT32_MAX, (0, 0, 0), "its rate at t_k"),
    *vector("setpoint", "2^-32 turn", 0, -(2**31), INT32_MAX, (0, 0, 0), "set-point r(k)"),
    Word("samples_lost", "", 0, 0, INT32_MAX, 0, "ticks stepped without a usable SAMPLE"),
    Word("overruns", "", 0, 0, INT32_MAX, 0, "SAMPLEs that found the board busy"),
    Word("dropped", "", 0, 0, INT32_MAX, 0, "SAMPLEs for a tick already stepped"),
    Word("saturations", "", 0, 0, INT32_MAX, 0, "ticks with the torque at its limit"),
)

LAWS: dict[tuple[int, int], LawTable] = {(table.law_id, table.version): table for table in laws.tables()}
C_LAWS = tuple(table for table in LAWS.values() if table.name in laws.IN_C)  # what a board with the C firmware has


def law_by_name(name: str) -> LawTable:
    """The newest table of the built-in law `name`; raises ConfigError that lists the known ones."""
    tables = [table for table in LAWS.values() if table.name == name]
    if not tables:
        known = ", ".join(sorted(table.name for table in LAWS.values()))
        raise ConfigError(f"law.name: expected one of {known}, got {name!r}", STATUS_UNKNOWN_LAW, 0)
    return max(tables, key=lambda table: table.version)


def user_table(name: str, params: Mapping[str, tuple[float, str, float]]) -> LawTable:
    """Table of a user's own law from its PARAMS {name: (default, unit, lsb)}; float form, no telemetry of its own."""
    words = tuple(
        Word(key, unit, 0, -lsb * 2**31, lsb * INT32_MAX, default, "", (), lsb)
        for key, (default, unit, lsb) in params.items()
    )
    return LawTable(USER_LAW_ID, 1, name, words, (), (0, 1, 2, 3, 4), (0.001, 60.0), (2, 1), READ_EULER)


# -- whole configurations ---------------------------------------------------------------------------------------------


class Configuration(NamedTuple):
    """CONFIG, understood. `common`, `params`: words by name; `values`: both as numbers in their units."""

    table: LawTable
    words: tuple[int, ...]
    common: dict[str, int]
    params: dict[str, int]
    values: dict[str, float]
    rows: tuple[tuple[int, int, int, int], ...]
    hash: int

    def vector(self, name: str) -> tuple[float, float, float]:
        """The three values name_x, name_y, name_z."""
        x, y, z = (self.values[f"{name}_{axis}"] for axis in AXES)
        return x, y, z


Value = float | str | bool | Sequence[Any]


def config_words(table: LawTable, values: Mapping[str, Value], rows: Sequence[Sequence[int]] = ()) -> tuple[int, ...]:
    """CONFIG words of a law. `values`: by word name, or by the name without _x, _y, _z for three; the rest: defaults.

    Raises ConfigError for unknown names, values out of range, and what the law itself excludes.
    """
    flat = expand(table, values)
    variant = variant_of(table, flat)
    flat = {**variant.defaults, "reference_lead": variant.reference_leads[0], "readings_mask": variant.needs, **flat}
    if table.float_only:
        flat = {"form": FORM_FLOAT, **flat}
    flat |= {"law_id": table.law_id, "law_version": table.version, "guidance_rows": len(rows)}
    words: dict[str, int] = {}
    for word in (*COMMON, *table.params):
        value = flat.get(word.name, word.default)
        if value == AUTOMATIC and word.default == AUTOMATIC:
            value = _automatic_bits(table, word, flat)
        words[word.name] = quantise(word, value, words)
    return (*words.values(), *(n for row in rows for n in row))


def variant_of(table: LawTable, values: Mapping[str, Value]) -> Variant:
    """The design of the law that these values, and its defaults for the others, choose."""
    flat = expand(table, values)
    return table.variant({word.name: number_of(word, flat.get(word.name, word.default)) for word in table.params})


def expand(table: LawTable, values: Mapping[str, Value]) -> dict[str, float | str | bool]:
    """Values by word name: a triple becomes three words, one number under a triple's name sets all three.

    A list or matrix becomes all its words, zero where it ends.
    """
    names = {word.name for word in (*COMMON, *table.params)}
    flat: dict[str, float | str | bool] = {}
    for name, value in values.items():
        if name in names:
            if not isinstance(value, str | int | float):
                raise ConfigError(f"{name}: expected one number, got {value!r}")
            flat[name] = value
        elif f"{name}_x" in names:
            flat |= zip((f"{name}_{axis}" for axis in AXES), _triple(name, value), strict=True)
        elif name in table.arrays:
            flat |= _array(table, name, value)
        else:
            raise ConfigError(_unknown(table, name))
    return flat


def _triple(name: str, value: Value) -> Sequence[float]:
    if isinstance(value, int | float):
        return (value,) * 3
    if isinstance(value, str) or len(value) != 3:
        raise ConfigError(f"{name}: expected 3 numbers, got {value!r}")
    return tuple(value)


def _array(table: LawTable, name: str, value: Value) -> dict[str, float]:
    shape = [table.sizes[size] for size in table.arrays[name]]
    given = elements(value, len(shape))
    if given is None or any(i > size for index in given for i, size in zip(index, shape, strict=True)):
        raise ConfigError(f"{name}: expected at most {' x '.join(map(str, shape))} numbers, got {value!r}")
    every = product(*(range(1, size + 1) for size in shape))
    return {"_".join((name, *map(str, index))): given.get(index, 0.0) for index in every}


def elements(value: object, depth: int) -> dict[tuple[int, ...], float] | None:
    """The numbers of a list (depth 1) or of a list of lists by their places, which count from 1; None: it is none."""
    if depth == 0:
        return {(): float(value)} if isinstance(value, int | float) else None
    if not isinstance(value, Sequence) or isinstance(value, str):
        return None
    found: dict[tuple[int, ...], float] = {}
    for number, item in enumerate(value, 1):
        inner = elements(item, depth - 1)
        if inner is None:
            return None
        found |= {(number, *index): each for index, each in inner.items()}
    return found


def _unknown(table: LawTable, name: str) -> str:
    words = [word for word in table.params if not word.name.endswith(("_y", "_z"))]
    known = sorted({array_of(table, word) or word.name.removesuffix("_x") for word in words})
    return f"law.params.{name}: unknown for law {table.name}; known: {', '.join(known)}"


def array_of(table: LawTable, word: Word) -> str:
    """The list or matrix that this word is an element of; empty: none."""
    name = word.name.rstrip("0123456789_")
    return name if name in table.arrays and word.name != name else ""


def _automatic_bits(table: LawTable, bits: Word, flat: Mapping[str, float | str | bool]) -> float:
    """The most fractional bits with which every word that uses them still fits int32."""
    users = [word for word in (*COMMON, *table.params) if word.q == bits.name]
    peak = max(abs(number_of(word, flat.get(word.name, word.default))) for word in users)
    best = int(bits.maximum)
    while best > bits.minimum and peak * 2.0**best > INT32_MAX:
        best -= 1
    return best


def parse_configuration(words: Sequence[int], user: LawTable | None = None) -> Configuration:
    """The inverse of config_words(); raises ConfigError with READY's status and the index of the bad word.

    `user`: the table of the one law that is not built in, if the board has one.
    """
    if len(words) < len(COMMON):
        raise ConfigError(f"CONFIG: expected at least {len(COMMON)} words, got {len(words)}", STATUS_MISSING)
    common = _named(COMMON, words, 0)
    table = _table_of(common["law_id"], common["law_version"], user)
    law_end = len(COMMON) + len(table.params)
    expected = law_end + ROW_WORDS * common["guidance_rows"]
    if len(words) != expected:
        raise ConfigError(f"CONFIG: expected {expected} words, got {len(words)}", STATUS_MISSING)
    params = _named(table.params, words[:law_end], len(COMMON))
    values = _values_in_range(table, common | params)
    return Configuration(table, tuple(words), common, params, values, _rows(words, law_end), table_hash(table, words))


def _named(table: Sequence[Word], words: Sequence[int], start: int) -> dict[str, int]:
    if len(words) < start + len(table):
        raise ConfigError(f"CONFIG: expected {start + len(table)} words or more, got {len(words)}", STATUS_MISSING)
    return {word.name: int(words[start + i]) for i, word in enumerate(table)}


def _table_of(law_id: int, version: int, user: LawTable | None) -> LawTable:
    if law_id == USER_LAW_ID and user is not None:
        return user
    table = LAWS.get((law_id, version))
    if table is None:
        known = ", ".join(f"{i} version {v} ({t.name})" for (i, v), t in sorted(LAWS.items()))
        message = f"CONFIG: law id {law_id} version {version} is unknown; known: {known}"
        raise ConfigError(message, STATUS_UNKNOWN_LAW, 0)
    return table


def _values_in_range(table: LawTable, counts: Mapping[str, int]) -> dict[str, float]:
    """Every word as a number; raises for the first outside its range, so before one whose LSB that word says."""
    values: dict[str, float] = {}
    for index, word in enumerate((*COMMON, *table.params)):
        value = dequantise(word, counts[word.name], counts)
        if not in_range(word, counts[word.name], counts):
            raise ConfigError(f"{word.name}: expected {range_text(word)}, got {value:g}", index=index)
        values[word.name] = value
    return values


def _rows(words: Sequence[int], start: int) -> tuple[tuple[int, int, int, int], ...]:
    rows: list[tuple[int, int, int, int]] = []
    for i in range(start, len(words), ROW_WORDS):
        tick, x, y, z = (int(n) for n in words[i : i + ROW_WORDS])
        if tick < 0 or (rows and tick <= rows[-1][0]):
            raise ConfigError(f"guidance row {len(rows)}: tick {tick} does not come after the row before", index=i)
        rows.append((tick, x, y, z))
    return tuple(rows)


def refusal(configuration: Configuration) -> str | None:
    """Why the law cannot fly with this configuration, in one line, or None: period, form, delay, lead, readings ..."""
    table, common = configuration.table, configuration.common
    variant = table.variant(configuration.values)
    low, high = table.period_s
    if not low * 1e6 <= common["period_us"] <= high * 1e6:
        return f"law {table.name}: expected period_s {low:g} to {high:g}, got {common['period_us'] * 1e-6:g}"
    if table.float_only and common["form"] != FORM_FLOAT:
        return f"law {table.name}: expected form float, got fixed"
    if common["transport_delay_ticks"] not in variant.transport_delays:
        known = ", ".join(map(str, variant.transport_delays))
        return f"law {table.name}: expected transport_delay_ticks {known}, got {common['transport_delay_ticks']}"
    if common["reference_lead"] not in variant.reference_leads:
        known = ", ".join(map(str, variant.reference_leads))
        return f"law {table.name}: expected reference_lead {known}, got {common['reference_lead']}"
    for name in table.finite_in_fixed:
        if common["form"] == FORM_FIXED and configuration.params[name] == NO_LIMIT:
            return f"law {table.name}: expected a finite {name} in the fixed form, got no limit"
    if variant.needs & ~common["readings_mask"]:
        return f"law {table.name}: expected readings_mask with bits {variant.needs}, got {common['readings_mask']}"
    if table.only_321 and configuration.values[table.only_321] and common["attitude_sequence"] != SEQUENCE_321:
        return f"law {_form_321(table)}: expected attitude_sequence 321, got 123"
    return None


def _form_321(table: LawTable) -> str:
    return table.name if table.only_321 == "law_id" else f"{table.name} with {table.only_321}"


def table_text(table: LawTable) -> str:
    """Canonical text of all words of a law; its hash and the tables of SPEC.md come from here."""
    lines = [f"law {table.law_id} {table.version}"]
    groups = (("common", COMMON), ("param", table.params), ("tel", (*TELEMETRY_COMMON, *table.telemetry)))
    for group, words in groups:
        lines += [f"{group} {w.name} {w.unit} {w.q} {w.minimum!r} {w.maximum!r} {w.lsb!r}" for w in words]
    return "\n".join(lines)


def table_hash(table: LawTable, words: Sequence[int]) -> int:
    """crc32 over table_text() and all CONFIG words: both ends agree on meaning and values. READY carries it."""
    return zlib.crc32(struct.pack(f"<{len(words)}i", *words), zlib.crc32(table_text(table).encode()))
