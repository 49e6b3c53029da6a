"""No raw * / % << >> & | ^ ~ on law values in C: `python -m tools.check_c_operations [FILE...]`, exit code 1 on any.

The laws compute with the named operations of fixed.h, which are Python's bit for bit: -7 / 2 is -3 in C and -4 in
Python, a shift to the left may overflow, a product of two int32 is undefined where it does not fit 32 bits. All of
firmware/core is looked at but fixed.h, fixed.c and the files of the board, which have no law values. Indices, sizeof
and constants among themselves may do as they like. No float either, and no <math.h>.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

CORE = Path(__file__).parent.parent / "firmware" / "core"
OPERATIONS = ("fixed",)
BOARD = ("board", "codec", "config", "flight", "frames", "hal", "port")

BANNED = {"*", "/", "%", "<<", ">>", "&", "|", "^", "~"}
SOMETIMES_UNARY = {"*", "&"}
KEYWORDS = {"return", "case", "else", "do", "sizeof"}
QUALIFIERS = {"const", "volatile", "restrict", "static", "extern", "inline"}
TYPES = {"void", "bool", "char", "short", "int", "long", "signed", "unsigned", "size_t", "float", "double"}
TOKEN = re.compile(
    r"(?P<name>[A-Za-z_]\w*)|(?P<number>\.?\d(?:[\w.]|[eEpP][+-])*)"
    r"|(?P<operator><<=|>>=|->|\+\+|--|&&|\|\||[<>=!+\-*/%&|^]=|<<|>>|[^\s\w])"
)
FLOAT = re.compile(r"(?!0[xX])[\d.]*(\.|[eE][+-]?\d)")


class Token(NamedTuple):
    """`kind`: name, number or operator."""

    kind: str
    text: str
    line: int


def main(argv: list[str] | None = None) -> int:
    """Prints file, line and operator of each."""
    parser = argparse.ArgumentParser(prog="python -m tools.check_c_operations", description=__doc__)
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help="default: the laws in firmware/core")
    files = parser.parse_args(argv).files or law_files()
    found = [f"{path}:{line}: {what}" for path in files for line, what in violations(path.read_text(encoding="utf-8"))]
    print("\n".join(found), end="\n" if found else "")
    return 1 if found else 0


def law_files(core: Path = CORE) -> list[Path]:
    """All of core but the operations themselves and the board."""
    return sorted(path for path in core.glob("*.[ch]") if path.stem not in OPERATIONS + BOARD)


def violations(source: str) -> list[tuple[int, str]]:
    """(line, what stands there) of each raw operation on a law value, each float, each <math.h>."""
    tokens = list(_tokens(source))
    types = TYPES | _declared_types(tokens)
    found = [(line, "<math.h>") for line in _lines_with(r"#\s*include\s*<t?g?math\.h>", source)]
    for at in _outside_of_indices(tokens):
        token = tokens[at]
        if token.text in ("float", "double") or (token.kind == "number" and FLOAT.match(token.text)):
            found.append((token.line, token.text))
        elif _is_banned(tokens, at, types):
            found.append((token.line, f"raw {token.text}"))
    return sorted(found)


def _is_banned(tokens: Sequence[Token], at: int, types: set[str]) -> bool:
    token = tokens[at]
    if token.kind != "operator" or (token.text not in BANNED and token.text.removesuffix("=") not in BANNED):
        return False
    before = tokens[at - 1] if at else Token("operator", ";", 0)
    after = tokens[at + 1] if at + 1 < len(tokens) else before
    if token.text in SOMETIMES_UNARY and not _ends_an_operand(before, types):
        return False
    return not (before.kind == after.kind == "number")


def _ends_an_operand(token: Token, types: set[str]) -> bool:
    """So what follows is an operation on it, no address, dereference or declaration of a pointer."""
    if token.kind == "name":
        return token.text not in KEYWORDS | QUALIFIERS | types and not token.text.endswith("_t")
    return token.kind == "number" or token.text in (")", "]")


def _outside_of_indices(tokens: Sequence[Token]) -> Iterator[int]:
    """Places of the tokens that are neither between [ and ] nor in the parentheses of sizeof."""
    depth, closing = 0, 0
    for at, token in enumerate(tokens):
        if token.text == "[":
            depth += 1
        elif token.text == "]":
            depth -= 1
        elif closing and token.text in "()":
            closing += 1 if token.text == "(" else -1
        elif token.text == "(" and at and tokens[at - 1].text == "sizeof":
            closing = 1
        elif depth == 0 and closing == 0:
            yield at


def _declared_types(tokens: Sequence[Token]) -> set[str]:
    """Names after struct, union, enum or at the end of a typedef here, and the types of the headers in core."""
    found = {b.text for a, b in pairwise(tokens) if a.text in ("struct", "union", "enum")}
    ends = re.compile(r"^}\s*(\w+);|^typedef\b[^{;]*?(\w+);", re.MULTILINE)
    for header in (*CORE.glob("*.h"), *CORE.glob("generated/*.h")):
        found |= {one or other for one, other in ends.findall(header.read_text(encoding="utf-8"))}
    return found


def _tokens(source: str) -> Iterator[Token]:
    for number, line in enumerate(_without_comments(source).split("\n"), 1):
        if re.match(r"\s*#\s*include", line):
            continue
        for match in TOKEN.finditer(line):
            yield Token(str(match.lastgroup), match.group(), number)


def _without_comments(source: str) -> str:
    """Comments, strings and characters as blanks; line breaks stay."""
    pattern = r"/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*'"
    return re.sub(pattern, lambda match: re.sub(r"[^\n]", " ", match.group()), source, flags=re.S)


def _lines_with(pattern: str, source: str) -> list[int]:
    return [number for number, line in enumerate(source.split("\n"), 1) if re.search(pattern, line)]


if __name__ == "__main__":
    sys.exit(main())
