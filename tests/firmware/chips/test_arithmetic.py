"""64-bit division and shifts of the images are Python's: what gyroscope, least squares and gains are computed with."""

from __future__ import annotations

import random

import pytest
from bare import Bare

from tools.firmware_image import IMAGES

MODULUS = 2**64
CASES = 4000
EDGES = (0, 1, 2**16, 2**31, 2**32, 2**48, 2**63, 2**64)


@pytest.fixture(scope="module")
def image():
    return Bare(IMAGES / "mps2-an386.elf")


def numbers(seed: int, count: int):
    """Pairs of 64-bit numbers of every size, many of them near a power of two or with halves of ones."""
    draw = random.Random(seed)
    for _ in range(count):
        yield tuple(
            draw.choice((
                lambda: draw.getrandbits(draw.randrange(1, 65)),
                lambda: -draw.getrandbits(draw.randrange(1, 64)),
                lambda: draw.choice(EDGES) + draw.randrange(-2, 3),
                lambda: (1 << draw.randrange(64)) + draw.randrange(-1, 2),
                lambda: draw.choice((0x8000, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF)) << draw.randrange(33),
            ))() % MODULUS
            for _ in range(2)
        )  # fmt: skip


def signed(value: int) -> int:
    return value - MODULUS if value >> 63 else value


def divided(image: Bare, name: str, dividend: int, divisor: int) -> tuple[int, int]:
    halves = [half for number in (dividend, divisor) for half in (number & 0xFFFFFFFF, number >> 32)]
    r0, r1, r2, r3 = image.call(image.symbols[name], *halves)
    return r0 | r1 << 32, r2 | r3 << 32


def test_unsigned_division(image):
    for dividend, divisor in numbers(1, CASES):
        expected = divmod(dividend, divisor) if divisor else (0, dividend)
        assert divided(image, "__aeabi_uldivmod", dividend, divisor) == expected, (dividend, divisor)


def test_signed_division_is_towards_zero(image):
    for dividend, divisor in numbers(2, CASES):
        n, d = signed(dividend), signed(divisor)
        quotient = 0 if d == 0 else (abs(n) // abs(d)) * (-1 if (n < 0) != (d < 0) else 1)
        expected = quotient % MODULUS, (n - quotient * d) % MODULUS
        assert divided(image, "__aeabi_ldivmod", dividend, divisor) == expected, (n, d)


@pytest.mark.parametrize(
    ("name", "shift"),
    [
        ("__aeabi_llsl", lambda value, by: value << by),
        ("__aeabi_llsr", lambda value, by: value >> by),
        ("__aeabi_lasr", lambda value, by: signed(value) >> by),
    ],
)
def test_shifts(image, name, shift):
    if name not in image.symbols:
        pytest.skip(f"{name}: this compiler shifts without it")
    for number, (value, _) in enumerate(numbers(3, CASES)):
        r0, r1, _, _ = image.call(image.symbols[name], value & 0xFFFFFFFF, value >> 32, number % 64)
        assert r0 | r1 << 32 == shift(value, number % 64) % MODULUS, (value, number % 64)
