"""Events in words: the level and the line for /log. Codes and the meaning of a and b are protocol.events'."""

from __future__ import annotations

from protocol import events
from protocol.events import EVENTS

ERRORS = frozenset((events.NAN, events.PLANT_NAN, events.DIVERGED, events.BOARD_RESTARTED))
NOTES = frozenset(
    (
        events.WATCHDOG_OFF,
        events.REFERENCE_RESTART,
        events.RECOVERED,
        events.LINK_UP,
        events.BOARD_ON,
        events.SETPOINT,
        events.FAULT_ENDS,
    )
)
OF_THE_HOST = frozenset((events.EPOCH_REBASED,))  # caused by this machine's clock alone: they go to timing.mcap


def level_of(code: int) -> str:
    """`error`, `warning` or `info`."""
    if code in ERRORS:
        return "error"
    return "info" if code in NOTES else "warning"


def describe(code: int, a: int, b: int) -> tuple[str, str]:
    """(level, one line): the code's name, what it means, and its two numbers with their meaning."""
    kind = EVENTS.get(code)
    if kind is None:
        return "warning", f"unknown event code 0x{code:04X} (a {a}, b {b})"
    numbers = ", ".join(_in_words(meaning, value) for meaning, value in ((kind.a, a), (kind.b, b)) if meaning)
    return level_of(code), f"{kind.name}: {kind.about}" + (f" ({numbers})" if numbers else "")


def _in_words(meaning: str, value: int) -> str:
    """`tick 7`; where the meaning lists choices, as in `why (0 late, 1 early)`, the one that it is: `why: early`."""
    name, _, choices = meaning.rstrip(")").partition(" (")
    for choice in choices.split(", "):
        number, _, text = choice.partition(" ")
        if number == str(value):
            return f"{name}: {text}"
    return f"{meaning} {value}"
