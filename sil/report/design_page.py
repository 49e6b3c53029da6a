"""A page of a design: Bode, Nichols and step response of its loops."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.linalg import expm

from sil.design.linear import Array, Complex, StateSpace, series
from sil.design.margins import continuous, held
from sil.design.sheet import Sheet, loop_of, stepped
from sil.report.colours import LIGHT, Look
from sil.report.look import DASHED, empty, finish, headed

HEIGHT_in = 9.2
LEFT, RIGHT = 0.075, 0.985
POINTS = 700
DASHES = ("-", DASHED, ":")  # of the loops, in order
SETTLED = 12.0  # of 1/crossover: how long the step is drawn
MOST_STEPS = 20_000
LOWEST_dB = -100.0  # of the Bode plot
FLOOR_dB, CEILING_dB = -40.0, 40.0  # of the Nichols chart


def design_page(sheet: Sheet, look: Look = LIGHT) -> Figure:
    """The page; loops that are not stable have no step."""
    figure = empty(HEIGHT_in, look)
    headed(figure, sheet.title, _facts(sheet), LEFT, look)
    crossover = next((found.crossover_radps for found in sheet.margins.values() if found.crossover_radps), 1.0)
    loops = _loops(sheet, np.geomspace(crossover / 100.0, crossover * 100.0, POINTS))
    magnitude = figure.add_axes((LEFT, 0.585, 0.40, 0.26))
    phase = figure.add_axes((LEFT, 0.275, 0.40, 0.26))
    nichols = figure.add_axes((0.565, 0.275, 0.42, 0.57))
    step = figure.add_axes((LEFT, 0.065, RIGHT - LEFT, 0.13))
    for (name, omega, L), colour, dash in zip(loops, look.runs, DASHES, strict=False):
        style: dict[str, Any] = {"color": colour, "lw": 1.6, "ls": dash, "label": name}
        dB, degrees = 20.0 * np.log10(np.abs(L)), _unwrapped(L)
        magnitude.plot(omega, dB, **style)
        phase.plot(omega, degrees, **style)
        seen = (dB > 1.3 * FLOOR_dB) & (dB < 1.3 * CEILING_dB)
        nichols.plot(degrees[seen], dB[seen], **style)
    _dress(magnitude, phase, nichols, look)
    _steps(step, sheet, crossover, look)
    return figure


def _facts(sheet: Sheet) -> str:
    found = next(iter(sheet.margins.values()))
    if not found.stable or found.crossover_radps is None or found.phase_deg is None:
        return "the loop is not stable"
    later = "never lost by delay" if found.delay_s is None else f"delay margin {found.delay_s:.3g} s"
    return f"continuous: crossover {found.crossover_radps:.3g} rad/s, phase margin {found.phase_deg:.3g} deg, {later}"


def _loops(sheet: Sheet, omega: Array) -> list[tuple[str, Array, Complex]]:
    """(name, frequencies, L) in the order of the margins; a sampled loop ends at its Nyquist frequency."""
    L = loop_of(sheet.C).response(omega)[:, 0, 0]
    found = [("continuous", omega, L)]
    if sheet.delay_s:
        found.append((f"delay {sheet.delay_s:g} s", omega, L * np.exp(-1j * omega * sheet.delay_s)))
    if sheet.sampling is not None:
        T = sheet.sampling.period_s
        C, plant = stepped(sheet.C, sheet.sampling)
        below = np.append(omega[omega < math.pi / T], math.pi / T)
        whole, fraction = _late(sheet)
        sampled = series(held(plant, T, fraction), C).response(below)[:, 0, 0]
        found.append((f"every {T:g} s", below, sampled * np.exp(-1j * below * whole * T)))
    return found


def _late(sheet: Sheet) -> tuple[int, float]:
    """(whole periods, the part of one) of the sampled loop's delay."""
    assert sheet.sampling is not None
    T = sheet.sampling.period_s
    late = sheet.sampling.ticks * T + sheet.sampling.sensor_delay_s
    whole = int(late / T + 1e-9)
    return whole, max(late - whole * T, 0.0)


def _unwrapped(L: Complex) -> Array:
    """Phase in deg, without jumps; it begins between -360 and 0."""
    degrees = np.degrees(np.unwrap(np.angle(L)))
    return np.asarray(degrees - 360.0 * math.ceil(float(degrees[0]) / 360.0))


def _dress(magnitude: Axes, phase: Axes, nichols: Axes, look: Look) -> None:
    for ax in (magnitude, phase):
        ax.set_xscale("log")
    finish(magnitude, "|L|", "dB", "Bode: loop gain", look, zero=True)
    magnitude.set_ylim(max(magnitude.get_ylim()[0], LOWEST_dB), None)
    finish(phase, "phase of L", "deg", "", look)
    phase.axhline(-180.0, color=look.faint, lw=0.7, zorder=1)
    phase.set_ylim(max(phase.get_ylim()[0], -720.0), None)
    phase.set_xlabel("rad/s", fontsize=10, color=look.ink)
    finish(nichols, "|L|", "dB", "Nichols: distance from the cross", look, zero=True)
    nichols.set(xlim=(-360.0, 0.0), ylim=(FLOOR_dB, CEILING_dB), xticks=range(-360, 1, 45))
    nichols.plot([-180.0], [0.0], marker="+", ms=14, mew=2.0, color=look.ink, zorder=5)
    nichols.set_xlabel("phase of L in deg", fontsize=10, color=look.ink)
    _circle(nichols, 0.5, look)
    nichols.legend(frameon=False, fontsize=10, loc="lower right", labelcolor=look.ink)


def _circle(ax: Axes, modulus: float, look: Look) -> None:
    """Where |1 + L| is this much."""
    L = -1.0 + modulus * np.exp(1j * np.linspace(-math.pi, math.pi, 400))
    ax.plot(np.degrees(np.angle(L)) % 360.0 - 360.0, 20.0 * np.log10(np.abs(L)), color=look.faint, lw=0.9, zorder=1)
    top = 20.0 * math.log10(1.0 + modulus)
    ax.text(-180.0, top + 1.0, f"|1 + L| = {modulus:g}", fontsize=9, color=look.faint, ha="center", va="bottom")


def _steps(ax: Axes, sheet: Sheet, crossover: float, look: Look) -> None:
    """Answer to a step of the set-point: continuous without delay, sampled with its own."""
    end = SETTLED / crossover
    loop = loop_of(sheet.C)
    ax.set_xlim(0.0, end)
    if continuous(loop).stable:
        t = np.linspace(0.0, end, POINTS)
        ax.plot(t, _continuous_step(loop, t), color=look.runs[0], lw=1.6)
    if sheet.sampling is not None and isinstance(sheet.C, StateSpace) and list(sheet.margins.values())[-1].stable:
        ax.plot(
            *_sampled_step(sheet, end),
            color=look.runs[2 if sheet.delay_s else 1],
            lw=1.6,
            ls=DASHES[2 if sheet.delay_s else 1],
        )
    finish(ax, "angle", "1", "Step of the set-point", look)
    ax.axhline(1.0, color=look.faint, lw=0.7, zorder=1)
    ax.set_xlabel("s", fontsize=10, color=look.ink)
    if not ax.lines[:-1]:
        ax.text(0.5, 0.5, "not stable", transform=ax.transAxes, ha="center", color=look.faint)


def _continuous_step(loop: StateSpace, t: Array) -> Array:
    n = loop.order
    block = np.zeros((n + 1, n + 1))
    block[:n, :n], block[:n, n:] = loop.A - loop.B @ loop.C, loop.B
    forward, x = expm(block * (t[1] - t[0])), np.zeros(n + 1)
    x[n] = 1.0
    y = np.zeros(len(t))
    for i in range(len(t)):
        y[i] = loop.C[0] @ x[:n]
        x = forward @ x
    return y


def _sampled_step(sheet: Sheet, end: float) -> tuple[Array, Array]:
    assert sheet.sampling is not None
    C, plant = stepped(sheet.C, sheet.sampling)
    T = sheet.sampling.period_s
    whole, fraction = _late(sheet)
    P = held(plant, T, fraction)
    steps = min(int(end / T) + 2, MOST_STEPS)
    x, z, y, sent = np.zeros(C.order), np.zeros(P.order), np.zeros(steps), [0.0] * (whole + 1)
    for k in range(steps):
        y[k] = P.C[0] @ z
        error = 1.0 - y[k]
        sent.append(float(C.C[0] @ x + C.D[0, 0] * error))
        x, z = C.A @ x + C.B[:, 0] * error, P.A @ z + P.B[:, 0] * sent[-1 - whole]
    return np.asarray(np.arange(steps) * T), y
