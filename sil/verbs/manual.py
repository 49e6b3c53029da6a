"""What --help shows of a verb: its docstring, with examples and exit codes set apart at the end.

In a docstring, the paragraph `Examples: sil a | sil b` and the one that begins with `Exit codes:` may stand anywhere
behind the first sentence.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

EXAMPLES = re.compile(r"Examples?: *")
EXIT_CODES = re.compile(r"Exit codes?: *")


class Said(NamedTuple):
    """What a verb's docstring says, paragraphs in one line each; `codes` are (exit code, meaning)."""

    summary: str
    prose: tuple[str, ...]
    examples: tuple[str, ...]
    codes: tuple[tuple[str, str], ...]


class Page(NamedTuple):
    """The text above the options of a verb, and the text below them."""

    help: str
    epilog: str


def said_of(verb: Callable[..., Any]) -> Said:
    """The parts of a verb's docstring."""
    first, *others = map(_one_line, inspect.cleandoc(verb.__doc__ or "").split("\n\n"))
    prose = tuple(each for each in others if not EXAMPLES.match(each) and not EXIT_CODES.match(each))
    examples = [line for each in others if (found := EXAMPLES.match(each)) for line in _split(each[found.end() :])]
    codes = [code for each in others if (found := EXIT_CODES.match(each)) for code in split_codes(each[found.end() :])]
    return Said(first, prose, tuple(examples), tuple(codes))


def page_of(verb: Callable[..., Any]) -> Page:
    """The page of a verb, in rich's markup; paragraphs are one line each, for the terminal to break."""
    said = said_of(verb)
    below = ["\n".join(["[bold]Examples[/]", *(f"[cyan]  {line}[/]" for line in said.examples)])]
    below = [*(below if said.examples else ()), *([_list_of(said.codes)] if said.codes else ())]
    return Page("\n\n".join([said.summary, *(f"[not dim]{each}[/]" for each in said.prose)]), "\n\n".join(below))


def exit_codes(text: str) -> str:
    """`0 passed, 1 a requirement failed; 130 interrupted.` as a list, a line each."""
    return _list_of(split_codes(text))


def split_codes(text: str) -> list[tuple[str, str]]:
    """(code, meaning) of each."""
    parts = re.split(r"[,;] (?=[0-9])", _one_line(text).removesuffix("."))
    return [(code, about) for code, _, about in (part.partition(" ") for part in parts)]


def _list_of(codes: Iterable[tuple[str, str]]) -> str:
    return "\n".join(["[bold]Exit codes[/]", *(f"[not bold]  {code:>3}  {about}[/]" for code, about in codes)])


def _split(examples: str) -> list[str]:
    """`sil a | sil b` are two examples; a pipe into another program is none."""
    return re.split(r" *\| +(?=sil )", examples)


def _one_line(text: str) -> str:
    return " ".join(text.split())
