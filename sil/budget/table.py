"""A budget as a table: instructions, milliseconds under a stated assumption, and how far they are from the baseline."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from rich.table import Table
from rich.text import Text

from sil.budget.judge import GROWTH
from sil.budget.measure import COUNTED, Budget, Instructions
from sil.screen.palette import BAD, DIM, GOOD

PAPERS_BOARD_MS = 345.0  # paper 004: one sample of the adaptive law on its ARM board
TITLES = {
    "law_step": "law step",
    "board_step": "board step: reference, law, limits",
    "answer": "answer, SAMPLE in one burst",
    "answer_bytewise": "answer, an interrupt a byte",
}


class Core(NamedTuple):
    """The assumption that turns instructions into time."""

    clock_MHz: float = 168.0
    cpi: float = 1.5  # cycles per instruction

    def ms(self, instructions: float) -> float:
        return instructions * self.cpi / (self.clock_MHz * 1e3)


def table(budget: Budget, core: Core, baseline: Mapping[str, float] | None) -> Table:
    made = Table(box=None, pad_edge=False, header_style="bold")
    for name, justify in (("law", "left"), ("instructions of", "left"), ("min", "right"), ("mean", "right")):
        made.add_column(name, justify=justify)  # type: ignore[arg-type]
    made.add_column("max", justify="right")
    made.add_column(f"max, ms at\n{core.clock_MHz:g} MHz", justify="right")
    if baseline is not None:
        made.add_column("max against\nbaseline", justify="right")
    for law, cost in budget.laws.items():
        for place, part in enumerate(COUNTED):
            counted: Instructions = getattr(cost, part)
            cells = [f"{counted.min:,}", f"{counted.mean:,.0f}", f"{counted.max:,}", f"{core.ms(counted.max):.3f}"]
            change = [_change(counted.max, baseline.get(f"{law}.{part}.max"))] if baseline is not None else []
            made.add_row(Text("" if place else law, "bold"), TITLES[part], *cells, *change)
    return made


def _change(now: float, then: float | None) -> Text:
    if not then:
        return Text("new", DIM)
    grown = now / then - 1.0
    return Text(f"{grown:+.1%}", BAD if grown > GROWTH else GOOD if grown < -GROWTH else DIM)


def below(budget: Budget, core: Core) -> Iterator[str]:
    """Memory, and what the figures mean."""
    size = budget.image_bytes
    stacks = ", ".join(f"{law} {cost.stack_bytes:,}" for law, cost in budget.laws.items())
    yield f"stack high water  {stacks} of {size['stack_reserved']:,} bytes"
    yield f"image             code {size['code']:,}, data {size['data']:,}, RAM {size['ram']:,} bytes with the stack"
    yield f"counted on        {budget.build}, manoeuvre A with noise, {budget.ticks:,} ticks"
    yield ""
    yield (
        f"Instructions are not cycles. Milliseconds assume {core.cpi:g} cycles per instruction (--cpi) at "
        f"{core.clock_MHz:g} MHz (--board-clock); a part with caches or flash wait states has others."
    )
    slowest = max(core.ms(cost.answer_bytewise.max or cost.answer.max) for cost in budget.laws.values())
    yield (
        f"The paper's board took {PAPERS_BOARD_MS:g} ms per sample; the longest answer here is {slowest:.2g} ms, "
        "without the wire's time."
    )
