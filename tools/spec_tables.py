"""The generated parts of protocol/SPEC.md: `python -m tools.spec_tables --write` renews them, `--check` compares.

Between `<!-- generated NAME -->` and `<!-- end NAME -->` stands what the function NAME below makes of the tables in
protocol/. Run --write after any change of layouts.py, events.py or law_tables.py; a test runs --check.
"""

from __future__ import annotations

import argparse
import difflib
import json
import math
import re
import sys
import zlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from protocol import frames as f
from protocol import layouts, link
from protocol.codec import encode
from protocol.config import MAX_PARTS, MAX_WORDS, split
from protocol.events import EVENTS, FIRST_LAB_CODE
from protocol.law_tables import (
    COMMON,
    LAWS,
    TELEMETRY_COMMON,
    LawTable,
    Word,
    config_words,
    table_hash,
    table_text,
)
from protocol.laws.pd import PD
from protocol.layouts import CTYPES, HEADER, HEADER_SIZE, LAYOUT_HASH, LAYOUTS, READINGS, Field, size_of
from tools.frame_json import hex_lines, to_json

SPEC = Path(__file__).parent.parent / "protocol" / "SPEC.md"
BLOCK = re.compile(r"(<!-- generated (\w+) -->\n)(.*?)(<!-- end \2 -->)", re.DOTALL)


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def field_rows(fields: Sequence[Field], at: int) -> Iterable[tuple[object, ...]]:
    """(offset in the packet, field, type, unit, meaning)."""
    for field in fields:
        ctype = field.ctype if field.length == 1 else f"{field.ctype}[{field.length}]"
        yield at, f"`{field.name}`", ctype, field.unit, field.about
        at += CTYPES[field.ctype][1] * field.length


FIELD_HEAD = ("at", "field", "type", "unit", "meaning")


def header() -> str:
    return table(FIELD_HEAD, field_rows(HEADER, 0))


def frames() -> str:
    parts = []
    for layout in LAYOUTS:
        size = HEADER_SIZE + size_of(layout.fields) + layouts.CRC_SIZE
        who = {"lab": "lab to board", "board": "board to lab", "both": "both ways"}[layout.sender]
        length = f"{size} bytes" if not layout.tail else f"{size} bytes and {layout.tail.split()[0]}"
        tick = "tick k" if layout.ticked else "tick NO_TICK"
        parts.append(f"### {layout.type.name}, type 0x{layout.type:02X}\n\n{who}; {tick}; {length}. {layout.about}.\n")
        rows = list(field_rows(layout.fields, HEADER_SIZE))
        if layout.tail == "words i32":
            rows.append((HEADER_SIZE + size_of(layout.fields), "`words`", "i32[n]", "", "n from the packet's length"))
        if rows:
            parts.append(table(FIELD_HEAD, rows))
    return "\n".join(parts)


def readings() -> str:
    rows = []
    for reading in READINGS:
        age, values = reading.fields
        rows.append((reading.bit, reading.name, f"{age.ctype} {age.unit}", f"{values.ctype}[{values.length}]",
                     values.unit, values.about, size_of(reading.fields)))  # fmt: skip
    return table(("bit", "reading", "age", "values", "unit", "meaning", "bytes"), rows)


def layout_text() -> str:
    return f"```layout\n{layouts.canonical_text()}```\n"


def layout_hash() -> str:
    tick = f.pack(f.Tick(7), 3)
    vectors = (
        (b"123456789", 0, "the usual check value"),
        (b"123456789", LAYOUT_HASH, "the same from L"),
        (tick[:-4], LAYOUT_HASH, "TICK(7), sequence 3, without its CRC"),
    )
    lines = [f"{data.hex()} {start:08x} {zlib.crc32(data, start):08x}  {about}" for data, start, about in vectors]
    return (
        f"**L = 0x{LAYOUT_HASH:08X}**; the register starts at L xor 0xFFFFFFFF = 0x{LAYOUT_HASH ^ 0xFFFFFFFF:08X} "
        "(for HELLO at 0xFFFFFFFF).\n\n```crc\n" + "\n".join(lines) + "\n```\n"
    )


def limits() -> str:
    rows = (
        ("packet", f"{f.MIN_PACKET} to {f.MAX_PACKET} bytes"),
        ("encoded candidate between zeros", f"{f.MIN_PACKET + 1} to {f.MAX_PACKET + 1} bytes"),
        ("words in one CONFIG part", f.MAX_CONFIG_WORDS),
        ("parts of one CONFIG", MAX_PARTS),
        ("words of one CONFIG", MAX_WORDS),
        ("words in one TELEMETRY", f.MAX_TELEMETRY_WORDS),
        ("EVENTs in one answer", 16),
        ("ticks ahead that are propagated", f.AHEAD_LIMIT),
        ("a sender that finds no room gives up after", f"{link.WRITE_TIMEOUT_S:g} s"),
    )
    return table(("limit", "value"), rows)


def events() -> str:
    board = [kind for kind in EVENTS.values() if kind.code < FIRST_LAB_CODE]
    lab = [kind for kind in EVENTS.values() if kind.code >= FIRST_LAB_CODE]
    head = ("code", "name", "when", "a", "b")
    rows = [[(f"0x{k.code:04X}", k.name, k.about, k.a or "0", k.b or "0") for k in side] for side in (board, lab)]
    return f"The board's:\n\n{table(head, rows[0])}\nThe laboratory's (recorded, never sent):\n\n{table(head, rows[1])}"


WORD_HEAD = ("word", "name", "LSB", "unit", "min", "max", "default", "meaning")


def word_rows(words: Sequence[Word], start: int) -> Iterable[tuple[object, ...]]:
    for index, word in enumerate(words, start):
        lsb = "1" if word.q == 0 else f"2^-{word.q}"
        about = word.about + (
            ": " + ", ".join(f"{i} {name}" for i, name in enumerate(word.choices)) if word.choices else ""
        )
        numbers = (number(word.minimum), number(word.maximum), number(word.default))
        default = "as many as fit" if word.default == -1 and word.minimum >= 0 else numbers[2]
        yield index, f"`{word.name}`", lsb, word.unit, *numbers[:2], default, about


def number(value: float) -> str:
    return "none" if math.isinf(value) else f"{value:.10g}"


def common() -> str:
    return table(WORD_HEAD, word_rows(COMMON, 0))


def telemetry() -> str:
    return table(WORD_HEAD, word_rows(TELEMETRY_COMMON, 0))


def laws() -> str:
    return "\n".join(one_law(law) for _, law in sorted(LAWS.items()))


def one_law(law: LawTable) -> str:
    low, high = law.period_s
    delays = ", ".join(map(str, law.transport_delays))
    leads = ", ".join(map(str, law.reference_leads))
    text = (
        f"### Law {law.law_id} version {law.version}: `{law.name}`\n\n"
        f"T_s {low:g} to {high:g} s; transport delay n: {delays}; reference lead d: {leads}; "
        f"readings mask {law.needs}.\n"
    )
    for index, variant in enumerate(law.variants):
        delays, leads = (", ".join(map(str, x)) for x in (variant.transport_delays, variant.reference_leads))
        other = f"; readings mask {variant.needs}" if variant.needs != law.needs else ""
        other += "".join(f"; default `{name}` {value:g}" for name, value in variant.defaults.items())
        text += f"`{law.variant_word}` = {index}: n {delays}; d {leads}{other}.\n"
    if law.only_321:
        text += f"Euler angles 3-2-1 only{'' if law.only_321 == 'law_id' else f', where `{law.only_321}` is not 0'}.\n"
    text += f"\nCONFIG:\n\n{table(WORD_HEAD, word_rows(law.params, len(COMMON)))}"
    return text + f"\nTELEMETRY:\n\n{table(WORD_HEAD, word_rows(law.telemetry, len(TELEMETRY_COMMON)))}"


def law_texts() -> str:
    blocks = []
    for _, law in sorted(LAWS.items()):
        text = table_text(law)
        blocks.append(f"`{law.name}`, CRC-32 0x{zlib.crc32(text.encode()):08X}:\n\n```law\n{text}\n```\n")
    return "\n".join(blocks)


def session() -> list[tuple[str, int, f.Frame]]:
    """The frames of the worked session: (what is said, sequence, frame)."""
    nonce, zero = 0x1122334455667788, (0, 0, 0)
    words = config_words(PD, {"telemetry_every": 100}, [(0, 0, 0, 0), (120, 0x11C71C72, 0, 0)])
    (part,) = split(words)
    start = (0x071C71C7, 0x071C71C7, 0x038E38E4)
    torque = (-394_863, -563_567, -286_419)
    sample = f.Sample(0, zero, zero, zero, f.NO_TICK, 6857, f.ZERO, f.EULER, (f.Reading(0, start), None, None))
    later = f.Sample(1, zero, torque, (49_358, 70_446, 35_802), 0, 6857, f.FRESH, f.EULER,
                     (f.Reading(0, (0x071B0000, 0x071C0000, 0x038E0000)), None, None))  # fmt: skip
    telemetry = f.Telemetry(0, PD.law_id, PD.version, (*start, *[0] * (len(TELEMETRY_COMMON) + len(PD.telemetry) - 3)))
    return [
        ("The lab opens a session, lockstep", 0, f.Hello(1, f.ROLE_LAB, 0, LAYOUT_HASH, nonce, 0, "sil 0.1")),
        ("The board echoes the nonce", 0, f.Hello(1, f.ROLE_BOARD, 5, LAYOUT_HASH, nonce, 0, "my board 3")),
        ("The lab configures law `pd` with two guidance rows, in one part", 0, part),
        ("The board is ready", 1, f.Ready(f.READY_OK, f.NO_INDEX, table_hash(PD, words))),
        ("SAMPLE(0): 10, 10 and 5 degrees, nothing acts yet", 1, sample),
        ("COMMAND(0) announces one more frame", 0, f.Command(0, torque, 0, 1, f.USED)),
        ("TELEMETRY(0), due every 100 ticks", 1, telemetry),
        ("SAMPLE(1): the torque of COMMAND(0) acts now (COMMAND(1), sequence 2, is not shown)", 2, later),
        ("The link lost SAMPLE(2), sequence 3: TICK(2) in its place", 1, f.Tick(2)),
        ("COMMAND(2): without a reading `pd` repeats its last command", 3, f.Command(2, torque, 0, 1, f.REPEATED)),
        ("EVENT(2): SAMPLE_LOST, one so far", 4, f.Event(2, 1, 2, 1)),
        ("TIMING(2), from a board that measures itself", 2, f.Timing(2, 41_000, 512, 0, 0)),
        ("The end", 2, f.Stop(f.STOP_DONE)),
    ]


def examples() -> str:
    blocks = []
    for about, sequence, frame in session():
        packet = f.pack(frame, sequence)
        fields = json.dumps(to_json(packet))
        blocks.append(
            f"{about}:\n\n```frame\n{fields}\n```\n\n```packet\n{hex_lines(packet)}\n```\n\n"
            f"```stream\n{hex_lines(encode(packet))}\n```\n"
        )
    return "\n".join(blocks)


MAKERS: dict[str, Callable[[], str]] = {
    maker.__name__: maker
    for maker in (
        header,
        frames,
        readings,
        layout_text,
        layout_hash,
        limits,
        events,
        common,
        telemetry,
        laws,
        law_texts,
        examples,
    )
}


def renewed(text: str) -> str:
    """SPEC with every generated block made anew; KeyError when a block has no maker."""
    return BLOCK.sub(lambda m: f"{m[1]}{MAKERS[m[2]]()}{m[4]}", text)


def main(argv: Sequence[str] | None = None) -> int:
    """0 in step, 1 not."""
    parser = argparse.ArgumentParser(prog="python -m tools.spec_tables", description=__doc__)
    parser.add_argument("--write", action="store_true", help="renew protocol/SPEC.md")
    parser.add_argument("--check", action="store_true", help="say what would change (the default)")
    options = parser.parse_args(argv)
    old = SPEC.read_text()
    new = renewed(old)
    missing = set(MAKERS) - {match[2] for match in BLOCK.finditer(old)}
    if missing:
        print(f"SPEC.md: no block for {', '.join(sorted(missing))}", file=sys.stderr)
        return 1
    if options.write:
        SPEC.write_text(new)
    elif old != new:
        changes = difflib.unified_diff(old.splitlines(), new.splitlines(), "SPEC.md", "tables", lineterm="", n=0)
        print("\n".join(changes))
        print("SPEC.md is out of step: python -m tools.spec_tables --write", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
