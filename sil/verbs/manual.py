"""What --help shows of a verb: its docstring, with examples and exit codes set apart at the end.

In a docstring, the paragraph `Examples: sil a | sil b` and the one that begins with `Exit codes:` may stand anywhere
behind the first sentence.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from typing import Any, NamedTuple

EXAMPLES = re.compile(r"Examples?: *")
EXIT_CODES = re.compile(r"Exit codes?: *")


class Page(NamedTuple):
    """The text above the options of a verb, and the text below them."""

    help: str
    epilog: str


def page_of(verb: Callable[..., Any]) -> Page:
    """The page of a verb, in rich's markup; paragraphs are one line each, for the terminal to break."""
    first, *others = inspect.cleandoc(verb.__doc__ or "").split("\n\n")
    examples = [EXAMPLES.sub("", each, count=1) for each in others if EXAMPLES.match(each)]
    codes = [EXIT_CODES.sub("", each, count=1) for each in others if EXIT_CODES.match(each)]
    prose = [_one_line(each) for each in others if not EXAMPLES.match(each) and not EXIT_CODES.match(each)]
    below = ["\n".join(["[bold]Examples[/]", *(f"[cyan]  {line}[/]" for line in _split(each))]) for each in examples]
    below += [exit_codes(each) for each in codes]
    return Page("\n\n".join([_one_line(first), *(f"[not dim]{each}[/]" for each in prose)]), "\n\n".join(below))


def _split(examples: str) -> list[str]:
    """`sil a | sil b` are two examples; a pipe into another program is none."""
    return re.split(r" *\| +(?=sil )", _one_line(examples))


def exit_codes(text: str) -> str:
    """`0 passed, 1 a requirement failed; 130 interrupted.` as a list, a line each."""
    parts = re.split(r"[,;] (?=[0-9])", _one_line(text).removesuffix("."))
    lines = [f"[not bold]  {code:>3}  {about}[/]" for code, _, about in (part.partition(" ") for part in parts)]
    return "\n".join(["[bold]Exit codes[/]", *lines])


def _one_line(text: str) -> str:
    return " ".join(text.split())
