"""Each named operation of fixed.h gives what fixed.py gives, at the edges and in between."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import c_build
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_sim import fixed

I32, I64 = ctypes.c_int32, ctypes.c_int64
ARGUMENTS: dict[str, tuple[Any, ...]] = {
    "wrap_bits": (I64, I32),
    "wrap32": (I64,),
    "clip": (I64, I64, I64),
    "sat32": (I64,),
    "add_sat": (I64, I64),
    "sub_sat": (I64, I64),
    "shift_round": (I64, I32),
    "mul_q": (I64, I64, I32),
    "mul_wide": (I64, I32, I32),
    "div_trunc": (I64, I64),
    "norm_shift": (I64,),
    "sin_q": (I64,),
    "cos_q": (I64,),
    "atan2_q": (I32, I32),
    "keep32": (I64, ctypes.POINTER(I32)),
}
# What of fixed.py is no operation that C has under its name: checks, and the halves of the sine.
NOT_IN_C = {"check32", "check64", "sin_eighth", "cos_eighth", "callee"}


class Operations:
    """The functions of the shared library at `path`, by name."""

    def __init__(self, path: Path) -> None:
        self._library = ctypes.CDLL(str(path))

    def __getitem__(self, name: str) -> Callable[..., int]:
        function = getattr(self._library, f"c_{name}")
        function.argtypes, function.restype = ARGUMENTS[name], I64
        return function  # type: ignore[no-any-return]

    def keep32(self, x: int, flag: int) -> tuple[int, int]:
        """(result, flag afterwards)."""
        word = I32(flag)
        return self["keep32"](x, word), word.value


def library(directory: Path, *options: str) -> Path:
    return c_build.build(directory / "operations.so", [c_build.HERE / "operations.c"], ["-shared", "-fPIC", *options])


@pytest.fixture(scope="module")
def c(tmp_path_factory: pytest.TempPathFactory) -> Operations:
    return Operations(library(tmp_path_factory.mktemp("operations"), "-O2"))


def test_every_operation_is_compared() -> None:
    names = {name for name, value in vars(fixed).items() if callable(value) and name not in NOT_IN_C}
    assert names == set(ARGUMENTS)


int32 = st.integers(-(2**31), 2**31 - 1)
int64 = st.integers(-(2**63), 2**63 - 1)
int62 = st.integers(-(2**62), 2**62 - 1)  # so that a sum or difference of two fits int64
many = settings(max_examples=300)


@many
@given(int62, st.integers(2, 62), int62, int62)
def test_wrapping_and_limits(c: Operations, x: int, n: int, a: int, b: int) -> None:
    assert c["wrap_bits"](x, n) == fixed.wrap_bits(x, n)
    assert c["wrap32"](x) == fixed.wrap32(x)
    assert c["sat32"](x) == fixed.sat32(x)
    assert c["clip"](x, a, b) == fixed.clip(x, a, b)
    assert c["add_sat"](a, b) == fixed.add_sat(a, b) and c["sub_sat"](a, b) == fixed.sub_sat(a, b)


@many
@given(int62, st.integers(1, 62), st.integers(0, 62))
def test_shift_round(c: Operations, x: int, right: int, left: int) -> None:
    assert c["shift_round"](x, right) == fixed.shift_round(x, right)
    small = x >> left  # so that the shift to the left stays within 64 bits
    assert c["shift_round"](small, -left) == fixed.shift_round(small, -left)


@many
@given(int32, int32, st.integers(0, 62), int62, int32, st.integers(30, 62))
def test_products(c: Operations, a: int, b: int, n: int, long: int, e: int, m: int) -> None:
    assert c["mul_q"](a, b, n) == fixed.mul_q(a, b, n)
    assert c["mul_wide"](long >> 2, e, m) == fixed.mul_wide(long >> 2, e, m)


@many
@given(int62, int62, int32, int32)
def test_division(c: Operations, a: int, b: int, small: int, divisor: int) -> None:
    for numerator, denominator in ((a, b), (a, divisor), (small, divisor), (small, b), (a, 0), (0, 0)):
        assert c["div_trunc"](numerator, denominator) == fixed.div_trunc(numerator, denominator)


@many
@given(int62, int32, int32)
def test_the_rest(c: Operations, x: int, y: int, angle: int) -> None:
    assert c["norm_shift"](x) == fixed.norm_shift(x)
    assert c["sin_q"](angle) == fixed.sin_q(angle) and c["cos_q"](angle) == fixed.cos_q(angle)
    assert c["atan2_q"](y, angle) == fixed.atan2_q(y, angle)


@given(int62, st.integers(0, 1))
def test_keep32(c: Operations, x: int, flag: int) -> None:
    state = np.array([flag], np.int64)
    assert c.keep32(x, flag) == (fixed.keep32(x, state, 0), int(state[0]))


EDGES32 = sorted(
    {s * (2**n + d) for n in (0, 1, 15, 28, 29, 30, 31) for d in (-1, 0, 1) for s in (-1, 1)}
    - {2**31, 2**31 + 1, -(2**31) - 1}
)
EDGES64 = sorted({s * (2**n + d) for n in (0, 31, 32, 33, 47, 61) for d in (-1, 0, 1) for s in (-1, 1)})


def cases() -> Iterator[tuple[str, tuple[int, ...]]]:
    """Operation and arguments: all pairs of edges, wherever Python's intermediates stay within 64 bits."""
    for a in EDGES64:
        for b in EDGES64:
            yield from (("div_trunc", (a, b)), ("add_sat", (a, b)), ("sub_sat", (a, b)), ("clip", (a, -abs(b), abs(b))))
        for n in (1, 2, 30, 31, 32, 33, 62):
            yield from (("shift_round", (a, n)), ("wrap_bits", (a, max(n, 2))))
        yield from ((name, (a,)) for name in ("wrap32", "sat32", "norm_shift"))
        for b in EDGES32:
            yield from (("mul_wide", (a >> 2, b, n)) for n in (30, 32, 33, 40, 62))
    for a in EDGES32:
        for b in EDGES32:
            yield ("atan2_q", (a, b))
            yield from (("mul_q", (a, b, n)) for n in (0, 1, 28, 30, 31, 34, 62))
        yield from (("sin_q", (a,)), ("cos_q", (a,)), ("sin_q", (a + 2**32,)))


def test_edges(c: Operations) -> None:
    functions = {name: c[name] for name in ARGUMENTS}
    wrong = [
        (name, arguments)
        for name, arguments in cases()
        if functions[name](*arguments) != getattr(fixed, name)(*arguments)
    ]
    assert wrong == []


def extremes() -> None:
    """sys.argv[1]: a library that stops at undefined behaviour. Every operation with what no law gives it."""
    c = Operations(Path(sys.argv[1]))
    functions = {name: c[name] for name in ARGUMENTS}
    for name, arguments in cases():
        functions[name](*arguments)
    worst = (-(2**63), 2**63 - 1, 2**62, -1, 0)
    for a in worst:
        for b in worst:
            for name in ("div_trunc", "add_sat", "sub_sat"):
                functions[name](a, b)
            for n in (-63, -1, 0, 1, 62, 63):
                functions["mul_q"](a, b, n)
                functions["shift_round"](a, n)
            for n in (1, 32, 62):
                functions["mul_wide"](a, b & 0x7FFFFFFF, n)
        for name in ("wrap32", "sat32", "norm_shift", "sin_q", "cos_q"):
            functions[name](a)


def test_no_argument_is_undefined_behaviour(tmp_path: Path) -> None:
    path = library(tmp_path, "-fsanitize=undefined", "-fno-sanitize-recover=all")
    code = "import test_operations_in_c as t; t.extremes()"
    repo = str(Path(__file__).resolve().parents[3])
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)],
        cwd=c_build.HERE,
        env={**os.environ, "PYTHONPATH": repo},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
