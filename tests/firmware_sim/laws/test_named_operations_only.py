"""The fixed forms use the named operations of fixed.py: `-7 // 2` is -4 in Python and -3 in C, `>>` differs too."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import firmware_sim

BANNED = (ast.Mult, ast.Div, ast.FloorDiv, ast.Mod, ast.LShift, ast.RShift, ast.Pow, ast.BitAnd, ast.BitOr, ast.BitXor)
PACKAGE = Path(firmware_sim.__file__).parent
FILES = sorted([*PACKAGE.glob("controllers/*.py"), *PACKAGE.glob("guidance/*.py"), *PACKAGE.glob("estimators/*.py")])


def banned_operations(source: str) -> Iterator[str]:
    """Line and operator of each raw operation in a function whose name says fixed; indices may do as they like.

    Constants among themselves (1 << 56) are no law values.
    """
    for function in ast.walk(ast.parse(source)):
        if isinstance(function, ast.FunctionDef) and "fixed" in function.name:
            for node in _outside_of_indices(function):
                operator = node.op if isinstance(node, ast.BinOp | ast.AugAssign) else None
                if isinstance(operator, BANNED) and not _constant(node):
                    yield f"{function.name}, line {node.lineno}: {type(operator).__name__}"
                if isinstance(node, ast.Constant) and isinstance(node.value, float):
                    yield f"{function.name}, line {node.lineno}: float {node.value}"


def _outside_of_indices(node: ast.AST) -> Iterator[ast.AST]:
    yield node
    for name, child in ast.iter_fields(node):
        if isinstance(node, ast.Subscript) and name == "slice":
            continue
        for item in child if isinstance(child, list) else [child]:
            if isinstance(item, ast.AST):
                yield from _outside_of_indices(item)


def _constant(node: ast.AST) -> bool:
    return isinstance(node, ast.BinOp) and all(isinstance(x, ast.Constant) for x in (node.left, node.right))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_no_raw_operation_on_law_values(path: Path) -> None:
    assert list(banned_operations(path.read_text())) == []


def test_the_ban_bites() -> None:
    source = "def f_fixed(s, i):\n    a = s[3 * i] * 2\n    a >>= 1\n    return a // 7 + (1 << 4) + 0.5\n"
    assert len(list(banned_operations(source))) == 4


def test_laws_call_no_libm_in_their_fixed_forms() -> None:
    for path in FILES:
        for function in ast.walk(ast.parse(path.read_text())):
            if isinstance(function, ast.FunctionDef) and "fixed" in function.name:
                names = {node.id for node in ast.walk(function) if isinstance(node, ast.Name)}
                assert not names & {"math", "float", "np"} - _annotations(function), f"{path.name}: {function.name}"


def _annotations(function: ast.FunctionDef) -> set[str]:
    found = [arg.annotation for arg in function.args.args if arg.annotation] + (
        [function.returns] if function.returns else []
    )
    return {node.id for annotation in found for node in ast.walk(annotation) if isinstance(node, ast.Name)}
