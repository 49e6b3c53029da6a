"""The loop as a picture: laboratory, cable and board, and what passes between them in one tick. An SVG of its own text.

Drawn on a light card, so that it reads on light and on dark pages.
"""

from __future__ import annotations

from html import escape

WIDTH, HEIGHT = 960, 404
_INK, _FAINT, _PAPER, _EDGE = "#1f2933", "#5b6776", "#fbfbfd", "#c9d1dc"
_LAB, _CABLE, _BOARD = "#0072B2", "#D55E00", "#00875f"
_FACES = "system-ui,-apple-system,'Segoe UI',Helvetica,Arial,'DejaVu Sans',sans-serif"


def drawn() -> str:
    """The SVG."""
    parts = [
        f'<rect width="{WIDTH}" height="{HEIGHT}" rx="10" fill="{_PAPER}" stroke="{_EDGE}"/>',
        _region(16, 444, "THE LABORATORY", "sil", _LAB),
        _region(690, 254, "THE BOARD", "firmware_sim, firmware", _BOARD),
        _text(575, 40, "THE CABLE", 16, _CABLE, bold=True),
        _text(575, 62, "protocol", 15, _FAINT),
        *_laboratory(),
        *_cable(),
        *_board(),
        *_log(),
    ]
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        f'font-family="{_FACES}">\n<title>The laboratory, the cable, the board: one tick</title>\n'
    )
    heads = "".join(_head(colour) for colour in (_INK, _CABLE, _LAB))
    return "\n".join((f"{head}<defs>{heads}</defs>", *parts, "</svg>\n"))


def _laboratory() -> list[str]:
    return [
        _box(32, 100, 180, 66, "satellite", "disturbances", _LAB),
        _box(264, 100, 180, 66, "sensors", "noise, steps, faults", _LAB),
        _box(264, 226, 180, 66, "one-sample delay", "fresh, held or zero", _LAB),
        _box(32, 226, 180, 66, "wheels", "limits, faults", _LAB),
        _arrow(212, 133, 264, 133),
        _arrow(264, 259, 212, 259),
        _arrow(122, 226, 122, 166),
        _text(134, 202, "torque", 14, _FAINT, middle=False),
    ]


def _cable() -> list[str]:
    return [
        _arrow(444, 133, 706, 133, _CABLE),
        _arrow(706, 259, 444, 259, _CABLE),
        _text(575, 122, "SAMPLE(k) at t_k", 16, _INK, bold=True),
        _text(575, 154, "readings, torque that acts", 14, _FAINT),
        _text(575, 193, "pty, UDP, serial", 16, _CABLE, bold=True),
        _text(575, 213, "modelled: loss, bits, delay", 14, _FAINT),
        _text(575, 248, "COMMAND(k)", 16, _INK, bold=True),
        _text(575, 280, "acts on [t_k+1, t_k+2)", 14, _FAINT),
    ]


def _board() -> list[str]:
    return [
        _box(706, 100, 222, 48, "reference model", "", _BOARD),
        _box(706, 160, 222, 72, "control law", "int32, identification", _BOARD),
        _box(706, 244, 222, 48, "limits, watchdog", "", _BOARD),
    ]


def _log() -> list[str]:
    return [
        _arrow(238, 310, 238, 342, _LAB),
        _text(238, 364, "run.mcap, timing.mcap, summary.json", 16, _INK, bold=True),
        _text(238, 387, "report, plot, live view, compare, replay, diff", 14, _FAINT),
        _text(817, 342, "in Python, in C,", 16, _INK, bold=True),
        _text(817, 364, "on an emulated Cortex-M,", 16, _INK, bold=True),
        _text(817, 387, "on your hardware: the same bytes", 14, _FAINT),
    ]


def _region(x: float, width: float, title: str, package: str, colour: str) -> str:
    size = f'x="{x}" y="78" width="{width}" height="232" rx="8"'
    frame = f'<rect {size} fill="{colour}" fill-opacity="0.06" stroke="{colour}" stroke-dasharray="5 4"/>'
    head = _text(x + width / 2, 40, title, 16, colour, bold=True)
    return frame + head + _text(x + width / 2, 62, package, 15, _FAINT)


def _box(x: float, y: float, width: float, height: float, title: str, below: str, colour: str) -> str:
    middle, centre = y + height / 2, x + width / 2
    text = _text(centre, middle + (-4 if below else 5), title, 17, _INK, bold=True)
    text += _text(centre, middle + 17, below, 14, _FAINT) if below else ""
    return f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="6" fill="white" stroke="{colour}"/>{text}'


def _text(x: float, y: float, text: str, size: int, colour: str, bold: bool = False, middle: bool = True) -> str:
    anchor, weight = ' text-anchor="middle"' if middle else "", ' font-weight="600"' if bold else ""
    return f'<text x="{x:g}" y="{y:g}" font-size="{size}" fill="{colour}"{anchor}{weight}>{escape(text)}</text>'


def _arrow(x1: float, y1: float, x2: float, y2: float, colour: str = _INK) -> str:
    ends = f'x1="{x1:g}" y1="{y1:g}" x2="{x2:g}" y2="{y2:g}"'
    return f'<line {ends} stroke="{colour}" stroke-width="2" marker-end="url(#head{colour[1:]})"/>'


def _head(colour: str) -> str:
    return (
        f'<marker id="head{colour[1:]}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" '
        f'orient="auto"><path d="M0 0L10 5L0 10z" fill="{colour}"/></marker>'
    )
