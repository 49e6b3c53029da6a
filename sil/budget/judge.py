"""A budget against what it may be: absolute limits, and a baseline above which nothing grows by more than 2 percent."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from sil.budget.measure import COUNTED, Budget
from sil.trouble import UsageError

GROWTH = 0.02
LAW_STEP_MOST = {"pd": 5_000, "appc": 20_000, "mrac": 40_000, "fvsc": 10_000, "state_space": 10_000}  # instructions
STACK_MOST, CODE_MOST = 2048, 32 * 1024  # bytes
JUDGED = ("mean", "max")  # of the instructions; the least is nobody's trouble


class Excess(NamedTuple):
    """Something costs more than it may; `allowed` as a person wants to read it."""

    what: str
    got: float
    allowed: str

    def __str__(self) -> str:
        return f"{self.what}: expected {self.allowed}, got {self.got:,g}"


def beyond_limits(budget: Budget) -> Iterator[Excess]:
    """The absolute ones."""
    for law, cost in budget.laws.items():
        most = LAW_STEP_MOST.get(law)
        if most is not None and cost.law_step.max > most:
            yield Excess(f"{law}: instructions per law step", cost.law_step.max, f"at most {most:,}")
        if cost.stack_bytes > STACK_MOST:
            yield Excess(f"{law}: stack in bytes", cost.stack_bytes, f"at most {STACK_MOST:,}")
    if budget.image_bytes["code"] > CODE_MOST:
        yield Excess("code in bytes", budget.image_bytes["code"], f"at most {CODE_MOST:,}")


def grown(budget: Budget, baseline: Mapping[str, float]) -> Iterator[Excess]:
    """Where a figure is more than 2 percent above the baseline's; figures that only one of them has are left out."""
    for name, now in figures(budget.plain()).items():
        then = baseline.get(name)
        if then is not None and now > then * (1.0 + GROWTH):
            yield Excess(name, now, f"at most {GROWTH:.0%} above {then:,g}")


def figures(plain: Mapping[str, Any]) -> dict[str, float]:
    """Every judged figure of a budget's JSON by its name, such as `mrac.law_step.max`."""
    found: dict[str, float] = {}
    for law, cost in plain["laws"].items():
        found |= {f"{law}.{part}.{one}": float(cost[part][one]) for part in COUNTED for one in JUDGED}
        found[f"{law}.stack_bytes"] = float(cost["stack_bytes"])
    return found | {f"image.{name}_bytes": float(plain["image_bytes"][name]) for name in ("code", "data", "ram")}


def read_baseline(file: Path) -> dict[str, float]:
    """What `sil pil-report --json` printed once. Raises UsageError."""
    try:
        return figures(json.loads(file.read_text(encoding="utf-8")))
    except OSError as error:
        raise UsageError(f"{file}: cannot read: {error.strerror}") from None
    except (ValueError, LookupError, TypeError, AttributeError):
        raise UsageError(f"{file}: expected what `sil pil-report --json` prints, got something else") from None
