"""What a conversation with a board means: who it is, how fast it answers, what went wrong, why nothing answers."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict

import numpy as np

from protocol import frames
from protocol.frames import Hello
from protocol.links.serial import LineErrors, parse_url
from protocol.port import PortCounters
from sil.doctor.findings import NOTE, OK, PROBLEM, Finding
from sil.doctor.overheard import Guess, guess, rows
from sil.doctor.talk import RoundTrips, Talk

PERCENTILES = {"p50": 50.0, "p99": 99.0, "p99_9": 99.9, "max": 100.0}
BINS = 32
FEW_FRAMES = 3
NO_COUNTERS = "this link has no framing, parity and overrun counters"
SLOW_NS = 4_000_000  # more than the wire explains
FAULTS = (
    "crc_errors",
    "cobs_errors",
    "too_long",
    "too_short",
    "discarded_bytes",
    "unknown",
    "sequence_gaps",
    "duplicates",
)


# -- who it is --------------------------------------------------------------------------------------------------------


def who(talk: Talk, board: Hello, unasked: Mapping[str, int]) -> Iterator[Finding]:
    """What the board says of itself, whether we understand each other, and what else was on the line."""
    timer = "own timer" if board.flags & frames.HELLO_OWN_TIMER else "no timer of its own: lockstep only"
    data = {
        "build": board.build,
        "protocol": board.protocol_version,
        "layout": f"{board.layout_hash:08x}",
        "own_timer": bool(board.flags & frames.HELLO_OWN_TIMER),
    }
    said = f"{board.build!r}, protocol {board.protocol_version}, layout {board.layout_hash:08x}, {timer}"
    ours = (frames.PROTOCOL_VERSION, frames.LAYOUT_HASH)
    if (board.protocol_version, board.layout_hash) == ours:
        yield Finding(OK, f"{said}; as here", data=data, check="board")
    else:
        expected = f"expected protocol {ours[0]}, layout {ours[1]:08x}: no run with this board"
        advice = "flash firmware that was built from these frame layouts (protocol/SPEC.md), or install its laboratory"
        yield Finding(PROBLEM, f"{said}; {expected}", advice, data=data, check="board")
    if set(unasked) - {"HELLO"}:
        named = ", ".join(f"{count} {name}" for name, count in unasked.items())
        found = f"before we said anything: {named}"
        yield Finding(NOTE, found, "the board was in a session, which our HELLO ended", check="unasked")
    garbage = talk.undecoded()
    if garbage:
        seen = guess(garbage)
        found = f"{talk.port.counters.discarded_bytes} bytes between the frames that were none: {seen.found}"
        yield Finding(NOTE, found, seen.advice, raw=rows(garbage), data={"kind": seen.kind}, check="undecoded")


# -- how fast ---------------------------------------------------------------------------------------------------------


def round_trips(talk: Talk, trips: RoundTrips, baud: int | None) -> Finding:
    """Percentiles, a histogram, and how much of it the wire takes."""
    if not trips.times_ns:
        return Finding(PROBLEM, f"none of {trips.tried} was answered", check="round trips")
    times_us = np.array(trips.times_ns) / 1000.0
    figures = {name: _rounded(float(np.percentile(times_us, q))) for name, q in PERCENTILES.items()}
    wire_us = talk.wire_ns / 1000
    counts, edges = histogram(times_us)
    data = {
        "asked": trips.asked,
        "answered": len(trips.times_ns),
        "lost": trips.lost,
        "stopped": trips.stopped,
        "us": figures,
        "wire_us": _rounded(wire_us),
        "wire_bytes": talk.exchange_bytes,
        "histogram": {"edges_us": [_rounded(edge) for edge in edges], "counts": counts},
    }
    scale, unit = (1000.0, "ms") if figures["p50"] >= 1000.0 else (1.0, "us")
    shown = ", ".join(f"{name.replace('_', '.')} {_short(value / scale)}" for name, value in figures.items())
    found = f"{len(trips.times_ns)} of {trips.asked}: {shown} {unit}"
    lines = (
        f"{_short(edges[0] / scale)} {bars(counts)} {_short(edges[-1] / scale)} {unit} (log)",
        *_share_of_the_wire(talk, baud, figures["p50"]),
    )
    if trips.lost:
        advice = "frames are lost on the way, or the board is too busy to read its port"
        why = f"; {trips.lost} not answered{f', ended because {trips.stopped}' if trips.stopped else ''}"
        return Finding(PROBLEM, found + why, advice, lines=lines, data=data, check="round trips")
    if trips.stopped:
        return Finding(NOTE, f"{found}; ended because {trips.stopped}", lines=lines, data=data, check="round trips")
    if baud is not None and figures["p50"] * 1000 - talk.wire_ns > SLOW_NS:
        advice = "far more than the wire takes: USB latency timer (above), or a board that looks at its port too rarely"
        return Finding(NOTE, found, advice, lines=lines, data=data, check="round trips")
    return Finding(OK, found, lines=lines, data=data, check="round trips")


def _share_of_the_wire(talk: Talk, baud: int | None, median_us: float) -> tuple[str, ...]:
    what = "HELLO and its echo: driver, wire, the board's decoder, and back; not the law"
    if baud is None:
        return (f"{what}; no wire time, for this link has no baud rate",)
    wire_us = talk.wire_ns / 1000
    share = min(1.0, wire_us / median_us)
    said = f"wire: {talk.exchange_bytes} bytes at {baud} baud are {wire_us / 1000:.2f} ms, {share:.0%} of the median"
    return what, f"{said}; the rest is {max(0.0, median_us - wire_us) / 1000:.2f} ms"


def histogram(times_us: np.ndarray, bins: int = BINS) -> tuple[list[int], list[float]]:
    """(counts, edges) over the whole range, the bins growing by the same ratio; times_us: (n,), n > 0, all > 0."""
    low, high = float(times_us.min()), float(times_us.max())
    edges = np.geomspace(low, max(high, low * 1.01), bins + 1)
    edges[0], edges[-1] = low, max(high, edges[-1])
    counts, _ = np.histogram(times_us, edges)
    return [int(count) for count in counts], [float(edge) for edge in edges]


def bars(counts: Sequence[int], glyphs: str = "▁▂▃▄▅▆▇█") -> str:
    """One character per bin: a blank for none, and a height that grows with the logarithm, so that a late one shows."""
    most = max(counts)
    if most == 0:
        return " " * len(counts)
    top = len(glyphs) - 1
    heights = np.log1p(np.asarray(counts)) / np.log1p(most) * top
    return "".join(
        glyphs[round(float(height))] if count else " " for count, height in zip(counts, heights, strict=True)
    )


def _rounded(value_us: float) -> float:
    return round(value_us, 1)


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= 100 else f"{value:.1f}" if value >= 10 else f"{value:.2f}"


# -- what went wrong --------------------------------------------------------------------------------------------------


def errors(talk: Talk, at_greeting: PortCounters, before: LineErrors | None, after: LineErrors | None) -> Finding:
    """Frames and bytes that were thrown away while we measured, and what the UART counted since we opened it."""
    now = talk.port.counters
    faults = {name: getattr(now, name) - getattr(at_greeting, name) for name in FAULTS}
    line = _since(before, after)
    data = {"port": faults, "line": line, "strangers": now.strangers}
    counted = ", ".join(
        f"{name.replace('_', ' ')} {count}" for name, count in {**faults, **(line or {})}.items() if count
    )
    no_line = "" if line is not None else f"; {NO_COUNTERS}"
    if not counted:
        clean = "CRC, framing, parity, overrun" if line is not None else "CRC, lengths, sequence numbers"
        return Finding(OK, f"none ({clean}){no_line}", data=data, check="errors")
    advice = "bits are changed or lost on the line: check ground, cable length and baud rate, and the receiver's buffer"
    return Finding(PROBLEM, f"while we measured: {counted}{no_line}", advice, data=data, check="errors")


def _since(before: LineErrors | None, after: LineErrors | None) -> dict[str, int] | None:
    if before is None or after is None:
        return None
    return {name: getattr(after, name) - getattr(before, name) for name in LineErrors._fields}


def line_lines(before: LineErrors | None, after: LineErrors | None) -> str:
    """`framing 12, parity 0, ...` since the port was opened, or that there is no such count."""
    line = _since(before, after)
    if line is None:
        return NO_COUNTERS
    return "the UART counted " + ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in line.items())


# -- why nothing answers ----------------------------------------------------------------------------------------------


def no_answer(talk: Talk, url: str, line: str) -> Iterator[Finding]:
    """No HELLO came back: what came instead, and what to look at, the likeliest first."""
    if talk.own_echoes:
        found = f"our own frames come back ({talk.own_echoes} of them)"
        advice = "transmit and receive are joined (a loop-back plug, a bridge), or the other end echoes what it reads"
        yield Finding(PROBLEM, found, advice, data={"own_echoes": talk.own_echoes}, check="hello")
    elif talk.port.counters.received:
        named = ", ".join(f"{count} {name}" for name, count in talk.types.most_common())
        found = f"frames come ({named}), yet HELLO is not answered"
        advice = "a board whose receive line is broken, or somebody else's laboratory on the other side of a pty"
        yield Finding(PROBLEM, found, advice, data={"types": dict(talk.types)}, check="hello")
    elif talk.heard.count:
        yield _garbage(talk, url, line)
    else:
        yield _silence(talk, url, line)


def _garbage(talk: Talk, url: str, line: str) -> Finding:
    data = bytes(talk.heard.kept)
    counters = talk.port.counters
    seen = DAMAGED if counters.crc_errors > counters.cobs_errors + counters.too_long + FEW_FRAMES else guess(data)
    question = " Wrong baud, or text?" if seen.kind not in ("few", "frames") else ""
    found = f"no HELLO came back, but {talk.heard.count} bytes that are no frame.{question} {_capital(seen.found)}"
    numbers = {"kind": seen.kind, "bytes": talk.heard.count, "first": data[:64].hex(), "port": asdict(counters)}
    commands = _terminal_program(url) if seen.kind == "text" else ()
    return Finding(PROBLEM, found, seen.advice, commands, (line,), numbers, "hello", rows(data))


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _terminal_program(url: str) -> tuple[str, ...]:
    if not url.startswith("serial:"):
        return ()
    path, baud = parse_url(url)
    return (f"{sys.executable} -m serial.tools.miniterm {path} {baud}",)


def _silence(talk: Talk, url: str, line: str) -> Finding:
    """Nothing at all came."""
    refused = getattr(talk.heard.inner, "refused", 0)
    if refused:
        found = f"nobody listens on {url} (refused {refused} times)"
        return Finding(PROBLEM, found, "start the board", (f"sil board --link {url}",), check="hello")
    pty = url.startswith("serial:///dev/pts/")
    causes = SILENT_UDP if talk.heard.datagram else SILENT_PTY if pty else SILENT_SERIAL
    found = "nothing came, neither unasked nor in answer to HELLO"
    return Finding(PROBLEM, found, "likeliest first:", lines=causes if pty else (*causes, line), check="hello")


DAMAGED = Guess(
    "frames",
    "frames whose CRC is wrong: bits change on the way, or another program's protocol",
    "check ground and cable length; a baud rate that is off by some percent does this, too",
)
SILENT_SERIAL = (
    "1. the board has power, and its program runs: press reset (at boot it says HELLO once)",
    "2. this is the port it speaks on (sil doctor lists them: which one is new when it is plugged in?)",
    "3. transmit to receive and receive to transmit, and a common ground",
    "4. the same baud rate at both ends: --try-bauds tries the usual ones",
    "5. levels: a 3.3 V board on an RS-232 port needs a converter",
    "6. the board waits for DTR or RTS, or is held in reset by them: both are inactive here",
)
SILENT_PTY = (
    "1. somebody holds the other side of this pty, and that is a board, not a laboratory",
    "2. of a pair of ptys, the board has one and the doctor the other: sil board --link serial:///dev/pts/N",
)
SILENT_UDP = (
    "1. the board runs and listens on this address and port, not on loopback only (udp://0.0.0.0:PORT)",
    "2. no firewall between: sudo nft list ruleset, at both ends",
    "3. the host is there: ping it",
    "4. no other laboratory is in a session with it: a board answers one at a time",
)
