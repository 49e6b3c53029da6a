"""The rungs: which board each one plugs in, in which arithmetic, and the scenario as it is flown there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from sil.runner import refuse_hopeless
from sil.scenario import Scenario, load_scenario
from sil.scenario_errors import one_of
from sil.scenario_law import is_user_law
from sil.trouble import UsageError

SET_HERE = ("board", "link", "link.url", "clock", "clock.mode", "law.form")  # by the rung: nobody else may
HARDWARE = ("serial:", "udp:")
FLOAT, FIXED = "float", "fixed"


class Rung(NamedTuple):
    """One step of the ladder. `about`: what runs there, for people; `form`: the law's arithmetic.

    counted: its instructions can be counted.
    """

    name: str
    about: str
    board: str
    form: str = FIXED
    counted: bool = False

    @property
    def folder(self) -> str:
        """Where its run is kept, below the ladder's directory."""
        return "hardware" if self.name.startswith(HARDWARE) else self.name


RUNGS = {
    rung.name: rung
    for rung in (
        Rung("float", "MIL: the float64 law, in the plant's process", "inproc", FLOAT),
        Rung("fixed", "SIL: the fixed-point law in Python, a process of its own", "process"),
        Rung("native", "SIL: the firmware in C, compiled for this machine", "native"),
        Rung("cortex-m", "PIL: the firmware's ARM image, on an emulated Cortex-M", "cortex-m", counted=True),
        Rung("qemu", "PIL: the same image in QEMU, over its UART", "qemu"),
    )
}
USUAL = ("float", "fixed", "native", "cortex-m")


def chosen(rungs: str | None, more: Sequence[str] = ()) -> tuple[Rung, ...]:
    """The rungs to climb, lowest first. rungs: `float,fixed,...`, None for the usual ones; more: further ones, by name
    or as the URL of a board that already runs. Raises UsageError.
    """
    named = list(USUAL) if rungs is None else [name.strip() for name in rungs.split(",")]
    wanted = list(dict.fromkeys(f"serial://{name}" if name.startswith("/dev/") else name for name in [*named, *more]))
    hardware = [name for name in wanted if name.startswith(HARDWARE)]
    for name in wanted:
        if name not in RUNGS and name not in hardware:
            option = "--with" if name in more else "--rungs"
            known = f"{one_of(RUNGS, name)}, /dev/X, serial:///dev/X?baud=N or udp://HOST:PORT"
            raise UsageError(f"{option}: expected {known}, got {name!r}")
    if len(hardware) > 1:
        raise UsageError(f"--with: expected one board that already runs, got {' and '.join(hardware)}")
    top = [Rung(url, "HIL: the board at this address", url) for url in hardware]
    return (*(rung for rung in RUNGS.values() if rung.name in wanted), *top)


def scenarios(name: str, sets: Sequence[str], rungs: Iterable[Rung]) -> list[tuple[Rung, Scenario]]:
    """The scenario as each rung flies it. Raises ScenarioInvalid; UsageError where it has no such ladder, or where
    `sil check` calls one of the flights hopeless.
    """
    for key in (text.partition("=")[0].strip() for text in sets):
        if key in SET_HERE:
            raise UsageError(f"--set {key}: each rung has its own; known: every key but {', '.join(SET_HERE)}")
    plain, wanted = load_scenario(name, sets), list(rungs)
    if plain.board == "none":
        raise UsageError(f"{plain.name}: expected a scenario with a board, got board none: there is no ladder to climb")
    fixed = [rung.name for rung in wanted if rung.form == FIXED]
    if is_user_law(plain.law.name) and fixed:
        got = f"rungs {', '.join(fixed)} (--rungs float leaves them out)"
        raise UsageError(f"law {plain.law.name}: a law of your own has a float form only, got {got}")
    flights = [(rung, load_scenario(name, [*sets, *_overrides(rung)])) for rung in wanted]
    for rung, scenario in flights:
        try:
            refuse_hopeless(scenario)
        except UsageError as error:
            raise UsageError(f"rung {rung.name}: {error}") from None
    return flights


def _overrides(rung: Rung) -> list[str]:
    return [f"board={rung.board}", "link.url=pty", "clock.mode=lockstep", f"law.form={rung.form}"]
