"""The live view as lines of text for a window of a given size: what matters most comes first, and goes last.

Colours are middle tones that can be read on dark and on light backgrounds; roll, pitch and yaw have the colours they
have in plots and in the 3D scene. Everything else is the terminal's own foreground, plain, bold or dim.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rich.text import Text

from sil.screen import charts, marks
from sil.screen.messages import State, Triple, error_deg
from sil.screen.palette import AXES, BAD, DIM, GOOD, TITLE, TONES, WARN
from sil.screen.seen import Seen, Times

WIDE = 130  # columns from which two blocks stand side by side
GAP = 4  # columns between them
LEAST_EVENTS = 4  # events that charts leave room for
CHART_LEAST, CHART_MOST = 5, 16  # lines of a row of charts
CHART_NARROWEST = 60  # columns of the window
BLANK = Text("")
GRAVE = frozenset(("real_misses", "crc_errors", "overruns", "restarts"))
ALWAYS = ("missed", "late", "real_misses", "overruns", "crc_errors", "discarded_bytes")
TRAFFIC = ("sent", "received")


def lines(seen: Seen, width: int, height: int) -> list[Text]:
    """At most `height` lines of at most `width` characters."""
    state = seen.state
    if state is None:
        return [header(seen, width)][:height]
    top = [header(seen, width), progress(seen, width)]
    blocks = _blocks(seen, state, width)
    while blocks and len(top) + sum(map(len, blocks)) > height:
        blocks.pop()
    rows = _spaced(top, blocks, height)
    rows += _charts(seen, width, height - len(rows) - 2 - min(len(seen.happenings), LEAST_EVENTS))
    room = height - len(rows)
    if room >= 2:
        rows += [BLANK, *events(seen, width, room - 1)]
    return [_cut(row, width) for row in rows[:height]]


def _charts(seen: Seen, width: int, room: int) -> list[Text]:
    """One row of charts or two, as high as `room` lines allow; none in a small window."""
    count = 2 if room >= 2 * (CHART_LEAST + 1) and seen.plan.follows else 1
    each = min(room // count - 1, CHART_MOST)
    if each < CHART_LEAST or width < CHART_NARROWEST or not charts.worth_drawing(seen):
        return []
    return [line for which in ("attitude", "error")[:count] for line in (BLANK, *charts.row(seen, which, width, each))]


def _blocks(seen: Seen, state: State, width: int) -> list[list[Text]]:
    """In order of importance; in a wide window in pairs."""
    half = (width - GAP) // 2 if width >= WIDE else width
    left = [attitude(seen, state, half), times(seen, half)]
    right = [wheels(seen, state, half), link(state, half)]
    if width < WIDE:
        return [block for pair in zip(left, right, strict=True) for block in pair if block]
    return [list(_beside(one, other, half)) for one, other in zip(left, right, strict=True)]


def _spaced(top: list[Text], blocks: Sequence[list[Text]], height: int) -> list[Text]:
    """Blank lines between the blocks where there is room for all of them."""
    roomy = len(top) + sum(len(block) + 1 for block in blocks) <= height
    rows = list(top)
    for block in blocks:
        rows += [BLANK, *block] if roomy else block
    return rows


def _beside(left: list[Text], right: list[Text], width: int) -> Iterator[Text]:
    for place in range(max(len(left), len(right))):
        row = left[place].copy() if place < len(left) else Text("")
        row.truncate(width, pad=True)
        row.append(" " * GAP)
        yield row.append_text(right[place]) if place < len(right) else row


def _cut(row: Text, width: int) -> Text:
    if row.cell_len > width:
        row.truncate(width, overflow="ellipsis")
    return row


# -- blocks --------------------------------------------------------------------------------------------------------


def header(seen: Seen, width: int) -> Text:
    """Scenario, law, clock, board and link."""
    plan = seen.plan
    return _cut(Text.assemble((plan.scenario, "bold"), *((f"   {part}", DIM) for part in plan.about)), width)


def progress(seen: Seen, width: int) -> Text:
    """How far, how fast, how long still."""
    state, plan = seen.state, seen.plan
    t_s = min((state.t_s if state else 0.0) + plan.period_s, plan.duration_s)
    left_s = seen.left_s
    tail = f"  {100 * seen.share:3.0f} %   {t_s:.{1 if plan.duration_s < 1000 else 0}f} of {plan.duration_s:g} s"
    if width >= 60:
        tail += f"   {_rate(seen.times_real_time)} real time"
    if left_s is not None:
        tail += "   over" if seen.ended else f"   {_clock(left_s)} left"
    bar, rest = marks.filled(seen.share, max(width - len(tail), 4))
    return Text.assemble((bar, GOOD if seen.share >= 1 else TITLE), (rest, DIM), tail)


def attitude(seen: Seen, state: State, width: int) -> list[Text]:
    """Per axis: attitude, what it is held against, the difference, and its history."""
    follows = seen.plan.follows
    held = state.held_against
    error = error_deg(held) if held is not None else None
    shown: Triple = held[1] if held is not None else state.attitude_deg
    head = f"{'attitude, deg':13}{'':>5}"
    if follows:
        head = f"{'deg':6}{'attitude':>10}{follows:>11}{'error':>10}"
    room = width - len(head) - 2 - 10
    title = f"|{'error' if follows else 'attitude'}| {charts.since(seen)}"
    rows = [Text.assemble((head, DIM), (f"  {title:<{max(room, 0)}}" if room >= 12 else "", DIM))]
    if room >= 12:
        rows[0].append(f"{'peak':>10}", DIM)
    for axis, name in enumerate(AXES):
        row = Text.assemble((f"{name:6}", TONES[axis]), (f"{number(shown[axis], 3):>{10 if follows else 12}}", "bold"))
        if follows:
            wanted = held[2] if held is not None else None
            row.append(f"{number(wanted[axis] if wanted else None, 3):>11}")
            row.append(f"{number(error[axis] if error else None, 4):>10}", "bold")
        if room >= 12:
            row.append(f"  {charts.past(seen, axis, room)}", TONES[axis]).append(f"{number(seen.peaks[axis], 3):>10}")
        rows.append(row)
    return rows


def wheels(seen: Seen, state: State, width: int) -> list[Text]:
    """Torque commanded and wheel momentum per axis, as bars against their limits."""
    half = (width - 6 - 2) // 2
    plan = seen.plan
    held = "" if state.source == "fresh" else f" ({state.source})"
    torques = _bars(f"torque, mN m{held}", state.torque_Nm, plan.torque_max_Nm, seen.torque_seen_Nm, 1e3, half)
    momenta = _bars("momentum, mN m s", state.momentum_Nms, plan.momentum_max_Nms, seen.momentum_seen_Nms, 1e3, half)
    rows = [Text.assemble(f"{'':6}", torques[0], "  ", momenta[0])]
    for axis, name in enumerate(AXES):
        rows.append(Text.assemble((f"{name:6}", TONES[axis]), torques[axis + 1], "  ", momenta[axis + 1]))
    return rows


def _bars(
    title: str, values: Triple, limits: Sequence[float | None], most_seen: float, scale: float, width: int
) -> list[Text]:
    """A title and three bars about zero; the end of a bar is the limit, or without one the most that was seen."""
    rows = [
        Text.assemble((title, WARN if title.endswith(")") else DIM), (f"{'limit':>{max(width - len(title), 0)}}", DIM))
    ]
    bar = (width - 8 - 1 - 7 - 1) // 2 * 2 + 1
    for axis, (value, limit) in enumerate(zip(values, limits, strict=True)):
        end = limit if limit is not None else most_seen
        share = value / end if end > 0 else 0.0
        at_limit = limit is not None and abs(value) >= limit * (1 - 1e-9)
        row = Text.assemble((f"{number(value * scale, 2):>8} ", "bold"))
        if bar >= 5:
            low, filled, high = marks.about_zero(share, bar)
            row.append(low, DIM).append(filled, BAD if at_limit else TONES[axis]).append(high, DIM)
        row.append(f"{'none' if limit is None else format(limit * scale, '.4g'):>7}", DIM)
        rows.append(_padded(row, width))
    return rows


def times(seen: Seen, width: int) -> list[Text]:
    """Deadline margin: lateness of the wake-ups and time to the answers, against the period. Nothing without either."""
    period_ms = seen.plan.wall_period_ms
    kinds = [("wake-up late", seen.late), ("answer after", seen.answers)]
    kinds = [(name, kind) for name, kind in kinds if kind]
    if not kinds:
        return []
    rebased = seen.state.rebased if seen.state is not None else 0
    head = Text.assemble((f"{'deadline, ms' if period_ms else 'board, ms':13}{'now':>8}{'p99':>9}{'worst':>9}", DIM))
    if period_ms:
        head.append(f"   {'of a period of ' + format(period_ms, '.4g') + ' ms':<{max(width - 39 - 3 - 10, 0)}}", DIM)
        head.append(f"{'margin':>10}", DIM)
    if rebased:
        head = Text.assemble((f"{head.plain[:39]}   ", DIM), (f"{rebased} ticks woke more than a period late", BAD))
    return [head, *(_times_row(name, kind, period_ms, width) for name, kind in kinds)]


def _times_row(name: str, kind: Times, period_ms: float | None, width: int) -> Text:
    p99 = kind.percentile(99)
    row = Text.assemble(
        (f"{name:13}", DIM), (f"{kind.now:8.3f}", "bold"), f"{p99:9.3f}", (f"{number(kind.worst, 3):>9}", "bold")
    )
    room = width - row.cell_len - 3 - 10
    if period_ms is None or room < 5:
        return row
    likely, _ = marks.filled(p99 / period_ms, room)
    worst, rest = marks.filled(kind.worst / period_ms, room)
    margin = 1.0 - kind.worst / period_ms
    tone = GOOD if margin >= 0.5 else WARN if margin > 0 else BAD
    row.append("   ").append(likely, tone).append(worst[len(likely) :], f"{tone} dim").append(rest, DIM)
    return row.append(f"{f'{100 * margin:.0f} %' if margin > 0 else 'none':>10}", tone)


def link(state: State, width: int) -> list[Text]:
    """The counters of link and commands: those that must be 0 in a good run always, the others once they count."""
    shown = [(name, count) for name, count in state.counters.items() if name in ALWAYS or count]
    if not shown:
        return []
    rows = [Text.assemble(("link   ", DIM))]
    for name, count in shown:
        words = Text.assemble((f"{name.replace('_', ' ')} ", DIM))
        words.append(f"{count:,}", _gravity(name, count))
        if rows[-1].cell_len > 7 and rows[-1].cell_len + words.cell_len > width:
            rows.append(Text(" " * 7))
        rows[-1].append_text(words).append("   ")
    for row in rows:
        row.rstrip()
    return rows


def _gravity(name: str, count: int) -> str:
    if not count or name in TRAFFIC:
        return "bold" if name in TRAFFIC else ""
    return BAD if name in GRAVE else WARN


def events(seen: Seen, width: int, height: int) -> list[Text]:
    """The last events in words; several of a kind in one line."""
    shown = sorted(seen.happenings, key=lambda one: one.t_s)[-(height - 1) :]
    rows = [Text("events" if shown else "events   none", DIM)]
    for one in shown:
        level, words = one.words()
        name, _, about = words.partition(": ")
        tone = {"error": BAD, "warning": WARN}.get(level, TITLE)
        times_seen = f" x {one.count}" if one.count > 1 else ""
        who = f"{one.who:<11}" if width >= 100 else ""
        row = Text.assemble((f"{one.t_s:9.3f} s  ", DIM), (who, DIM), (name + times_seen, tone), "  ")
        short, _, numbers = about.partition(" (")
        fits = not numbers or row.cell_len + len(about) <= width
        rows.append(_cut(row.append(about if fits else short), width))
    return rows


# -- numbers -------------------------------------------------------------------------------------------------------


def number(value: float | None, decimals: int) -> str:
    """Fixed point, with fewer decimals or an exponent where it would be too long for a column; `-` for none."""
    if value is None or not math.isfinite(value):
        return "-" if value is None or math.isnan(value) else f"{value}"
    for places in range(decimals, -1, -1):
        text = f"{value:.{places}f}"
        if len(text) <= 8:
            return "0." + "0" * places if text.strip("-0.") == "" and places else text
    return f"{value:.1e}"


def _rate(times_real_time: float) -> str:
    return f"{times_real_time:,.0f} x" if times_real_time >= 9.95 else f"{times_real_time:.2g} x"


def _clock(seconds: float) -> str:
    whole = math.ceil(seconds)
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02d}:{whole % 60:02d}" if hours else f"{minutes}:{whole % 60:02d}"


def _padded(row: Text, width: int) -> Text:
    row.truncate(width, pad=True)
    return row
