"""What `--vary KEY=SPEC` means: values that are listed and combined, or a distribution that is drawn from.

| SPEC | what |
|---|---|
| a:b:n | n points from a to b, both ends included |
| a:b | every whole number from a to b |
| a,b,c | these values (YAML: numbers, texts, true, [1, 2, 3]) |
| uniform(a,b) | drawn evenly from a to b; whole numbers, both ends included, where the key holds a whole number |
| log(a,b) | drawn evenly in the logarithm |
| normal(m,s) | drawn from a normal distribution of mean m and standard deviation s |
| choice(a,b,c) | one of these values |
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Sequence
from statistics import NormalDist
from typing import Any, NamedTuple

from sil.scenario_errors import one_of, shown
from sil.scenario_yaml import NUMBER_FLOAT, NUMBER_INT, read_value
from sil.trouble import UsageError

MOST_POINTS = 100_000
NEAT_DIGITS = 12  # 0.5:0.9:9 means 0.6, not 0.6000000000000001
SMALLEST = 2.0**-54  # a normal distribution has no value at 0

_CALL = re.compile(r"([A-Za-z_]\w*)\s*\((.*)\)", re.DOTALL)
SPECS = "a:b:n, a:b, a,b,c, uniform(a,b), log(a,b), normal(m,s) or choice(a,b,c)"


class Axis(NamedTuple):
    """One varied key. Listed: `values`. Drawn: `draw` makes a value of a fraction in [0, 1); `values` is empty."""

    key: str
    spec: str  # as the user wrote it
    values: tuple[Any, ...]
    draw: Callable[[float], Any] | None = None


def parse_axis(key: str, spec: Any, held: Any, where: str) -> Axis:
    """The axis that `spec` describes; raises UsageError.

    spec: a text as in the table above, or (from a file) a list of values or a single one. held: what the scenario has
    at `key`: where that is a whole number, the axis has whole numbers. where: the place of the spec, for messages.
    """
    if not isinstance(spec, str):
        values = spec if isinstance(spec, tuple | list) else (spec,)
        return Axis(key, shown(spec), _listed(tuple(values), where, shown(spec)))
    text = spec.strip()
    refuse_unwritable(text, where)
    if (call := _CALL.fullmatch(text)) is not None:
        return Axis(key, text, (), _distribution(call[1], _items(call[2], where), held, where, text))
    parts = [part.strip() for part in text.split(":")]
    if len(parts) in (2, 3) and all(_is_number(part) for part in parts):
        return Axis(key, text, _range(parts, held, where, text))
    return Axis(key, text, _listed(_items(text, where), where, text))


# -- listed -----------------------------------------------------------------------------------------------------------


def refuse_unwritable(value: Any, where: str) -> None:
    """UsageError for what no plan can hold: NaN, infinity, and text that is none (half a surrogate pair)."""
    if isinstance(value, float) and not math.isfinite(value):
        raise UsageError(f"{where}: expected finite numbers, got {value}")
    if isinstance(value, str) and not _is_text(value):
        raise UsageError(f"{where}: expected text that UTF-8 can hold, got {value!r}")
    items = [*value.keys(), *value.values()] if isinstance(value, dict) else value
    if isinstance(items, tuple | list):
        for item in items:
            refuse_unwritable(item, where)


def _is_text(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _listed(values: tuple[Any, ...], where: str, text: str) -> tuple[Any, ...]:
    if not values:
        raise UsageError(f"{where}: expected {SPECS}, got {text or 'nothing'}")
    refuse_unwritable(values, where)
    if len({json.dumps(value) for value in values}) < len(values):
        raise UsageError(f"{where}: expected each value once, got {text}")
    return values


def _items(text: str, where: str) -> tuple[Any, ...]:
    """`a, [1, 2], "x:y"` as YAML reads it inside of a list."""
    try:
        items = read_value(f"[{text}]", where)
    except ValueError:  # ScenarioInvalid, too; or a number of thousands of digits
        items = None
    if not isinstance(items, tuple):
        raise UsageError(f"{where}: expected {SPECS}, got {text}")
    return items


def _range(parts: Sequence[str], held: Any, where: str, text: str) -> tuple[Any, ...]:
    whole_ends = all(NUMBER_INT.fullmatch(part) for part in parts[:2])
    low, high = (float(part) for part in parts[:2])
    refuse_unwritable([low, high, high - low], where)
    if len(parts) == 2:
        if not whole_ends or high < low:
            raise UsageError(f"{where}: expected a:b:n (n points), or whole numbers a <= b for a:b, got {text}")
        _bounded(int(high) - int(low) + 1, where)
        numbers = range(int(parts[0]), int(parts[1]) + 1)
        return tuple(float(n) if isinstance(held, float) else n for n in numbers)
    if not NUMBER_INT.fullmatch(parts[2]) or int(parts[2]) < 2 or low == high:
        raise UsageError(f"{where}: expected a:b:n, two different ends and at least 2 points, got {text}")
    count = _bounded(int(parts[2]), where)
    points = [low + (high - low) * i / (count - 1) for i in range(count)]
    neat = [low, *(float(f"{point:.{NEAT_DIGITS}g}") for point in points[1:-1]), high]
    if isinstance(held, float) or not whole_ends:
        if _holds_whole(held):
            raise UsageError(f"{where}: expected whole numbers, got {text}")
        return tuple(neat)
    if all(value == round(value) for value in neat):
        return tuple(int(value) for value in neat)
    if _holds_whole(held):
        expected = f"points that are whole numbers (every one of them: {parts[0]}:{parts[1]})"
        raise UsageError(f"{where}: expected {expected}, got {text}")
    return tuple(neat)


def _bounded(count: int, where: str) -> int:
    if count > MOST_POINTS:
        raise UsageError(f"{where}: expected at most {MOST_POINTS} points, got {count}")
    return count


# -- drawn ------------------------------------------------------------------------------------------------------------


def _distribution(name: str, arguments: tuple[Any, ...], held: Any, where: str, text: str) -> Callable[[float], Any]:
    if name not in DISTRIBUTIONS:
        raise UsageError(f"{where}: expected {one_of(DISTRIBUTIONS, name)}, got {text} (a text is written in quotes)")
    refuse_unwritable(arguments, where)
    if name != "choice":
        numbers = [value for value in arguments if isinstance(value, int | float) and not isinstance(value, bool)]
        if len(arguments) != 2 or len(numbers) != 2 or not all(map(math.isfinite, numbers)):
            raise UsageError(f"{where}: expected {name}(a,b) with two numbers, got {text}")
    try:
        draw = DISTRIBUTIONS[name](arguments, _holds_whole(held))
        for end in (0.0, 1.0 - 2.0**-53):
            refuse_unwritable(draw(end), where)
        return draw
    except OverflowError:
        raise UsageError(f"{where}: expected {name}(a,b) of finite numbers, got {text}") from None
    except UsageError:
        raise
    except ValueError as error:
        raise UsageError(f"{where}: expected {error}, got {text}") from None


def _uniform(arguments: tuple[Any, ...], whole: bool) -> Callable[[float], Any]:
    low, high = arguments
    if high <= low:
        raise ValueError("uniform(a,b) with a below b")
    if not whole:
        return lambda u: low + (high - low) * u
    if not isinstance(low, int) or not isinstance(high, int):
        raise ValueError("whole numbers, since the key holds one")
    return lambda u: min(high, low + math.floor(u * (high - low + 1)))


def _log(arguments: tuple[Any, ...], whole: bool) -> Callable[[float], Any]:
    low, high = arguments
    if not 0 < low < high:
        raise ValueError("log(a,b) with 0 < a < b")
    start, span = math.log(low), math.log(high) - math.log(low)
    return _rounded(lambda u: min(max(math.exp(start + span * u), low), high), whole)


def _normal(arguments: tuple[Any, ...], whole: bool) -> Callable[[float], Any]:
    mean, sigma = arguments
    if sigma <= 0:
        raise ValueError("normal(m,s) with s above 0")
    inverse = NormalDist(mean, sigma).inv_cdf
    return _rounded(lambda u: inverse(max(u, SMALLEST)), whole)


def _choice(arguments: tuple[Any, ...], whole: bool) -> Callable[[float], Any]:
    if not arguments:
        raise ValueError("choice(a,b,c) with at least one value")
    return lambda u: arguments[min(math.floor(u * len(arguments)), len(arguments) - 1)]


def _rounded(value: Callable[[float], float], whole: bool) -> Callable[[float], Any]:
    return (lambda u: round(value(u))) if whole else value


DISTRIBUTIONS: dict[str, Callable[[tuple[Any, ...], bool], Callable[[float], Any]]] = {
    "uniform": _uniform,
    "log": _log,
    "normal": _normal,
    "choice": _choice,
}


def _is_number(text: str) -> bool:
    return bool(NUMBER_INT.fullmatch(text) or NUMBER_FLOAT.fullmatch(text))


def _holds_whole(held: Any) -> bool:
    return isinstance(held, int) and not isinstance(held, bool)
