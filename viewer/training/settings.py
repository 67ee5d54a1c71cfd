"""What a training in the window is asked for: budgets as the user types them, and the settings with their defaults."""

import re
from dataclasses import dataclass
from typing import Literal

from ntc.codec.config import GroupingName, RecipeName
from ntc.errors import InputError
from ntc.worker.protocol import Budget, QualityBudget, StepBudget, TimeBudget

BudgetUnit = Literal["steps", "s", "dB"]
MOST_SECONDS = 7 * 24 * 3600.0
MOST_STEPS = 10_000_000
MOST_DECIBELS = 60.0
LARGEST_SIZE = 16384
DEFAULT_BUDGET = TimeBudget(30.0)
AUTO = "auto"
"""As many groups as the grouping makes where nobody says how many."""
_BUDGET = re.compile(r"\s*(\d+(?:\.\d+)?)\s*(steps|s|dB)\s*", re.IGNORECASE)


def parse_budget(text: str) -> Budget:
    """The budget that `500steps`, `30s` or `35dB` stands for. Raises InputError."""
    found = _BUDGET.fullmatch(text)
    if found is None:
        raise InputError(f"budget {text!r}: must be steps, seconds or a PSNR: 500steps, 30s or 35dB")
    return make_budget(float(found[1]), next(unit for unit in BUDGET_UNITS if unit.lower() == found[2].lower()))


def make_budget(value: float, unit: BudgetUnit) -> Budget:
    """A budget in a unit. Raises InputError for a value out of range."""
    most = {"steps": MOST_STEPS, "s": MOST_SECONDS, "dB": MOST_DECIBELS}[unit]
    if not 0 < value <= most or (unit == "steps" and value != int(value)):
        whole = "a whole number " if unit == "steps" else ""
        raise InputError(f"budget {value:g}{unit}: must be {whole}above 0 and at most {most:g}{unit}")
    if unit == "steps":
        return StepBudget(int(value))
    return TimeBudget(value) if unit == "s" else QualityBudget(value)


BUDGET_UNITS: tuple[BudgetUnit, ...] = ("steps", "s", "dB")


def budget_text(budget: Budget) -> str:
    """A budget as it is typed."""
    if isinstance(budget, StepBudget):
        return f"{budget.steps}steps"
    return f"{budget.seconds:g}s" if isinstance(budget, TimeBudget) else f"{budget.psnr_db:g}dB"


@dataclass(frozen=True)
class TrainingSettings:
    """Small and quick unless the user asks for more."""

    strategy: GroupingName = "clustered"
    clusters: int | None = None
    """None: as many as the grouping makes where nobody says how many."""
    texture_size: int = 256
    """Most texels of a texture along one side; smaller ones stay as they are."""
    recipe: RecipeName = "best"
    budget: Budget = DEFAULT_BUDGET


def read_clusters(text: str) -> int | None:
    """Groups, or None for `auto`. Raises InputError."""
    if text == AUTO:
        return None
    if not text.isdecimal() or not 1 <= int(text) <= 100_000:
        raise InputError(f"k {text!r}: must be a whole number from 1, or {AUTO}")
    return int(text)


def read_size(text: str) -> int:
    """Texels along one side. Raises InputError."""
    if not text.isdecimal() or not 4 <= int(text) <= LARGEST_SIZE:
        raise InputError(f"size {text!r}: must be 4 to {LARGEST_SIZE} texels")
    return int(text)
