"""Settings of a training in the window with their defaults, and how the user types them."""

import re
from dataclasses import dataclass
from typing import Literal, get_args

from ntc.codec.config import GroupingName
from ntc.codec.encoding import (
    DEFAULT_BITS,
    BitsTarget,
    Budget,
    EncodingChoices,
    QualityBudget,
    RecipeName,
    StepBudget,
    TimeBudget,
)
from ntc.codec.registry import chosen_codec, codec_named
from ntc.errors import InputError

BudgetUnit = Literal["steps", "s", "dB"]
BUDGET_UNITS: tuple[BudgetUnit, ...] = get_args(BudgetUnit)
LARGEST_BUDGETS: dict[BudgetUnit, float] = {"steps": 10_000_000, "s": 7 * 24 * 3600.0, "dB": 60.0}
SIZES = (4, 16384)
"""Least and most texels along one side."""
MOST_CLUSTERS = 100_000
DEFAULT_BUDGET = TimeBudget(30.0)
AUTO = "auto"
"""The number of groups where the grouping is to choose it; the codec where recipe and budget are to."""
LARGEST_BITS = 1000.0
"""More are refused before anything is prepared; how many can be had depends on the textures."""


def parse_budget(text: str) -> Budget:
    """Return the budget written as `500steps`, `30s` or `35dB`. Raises InputError."""
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(steps|s|dB)\s*", text, re.IGNORECASE)
    if found is None:
        raise InputError(f"budget {text!r}: must be steps, seconds or a PSNR: 500steps, 30s or 35dB")
    return make_budget(float(found[1]), next(unit for unit in BUDGET_UNITS if unit.lower() == found[2].lower()))


def make_budget(value: float, unit: BudgetUnit) -> Budget:
    """Return a budget in a unit. Raises InputError for a value out of range."""
    most = LARGEST_BUDGETS[unit]
    if not 0 < value <= most or (unit == "steps" and value != int(value)):
        whole = "a whole number " if unit == "steps" else ""
        raise InputError(f"budget {value:g}{unit}: must be {whole}above 0 and at most {most:g}{unit}")
    if unit == "steps":
        return StepBudget(int(value))
    return TimeBudget(value) if unit == "s" else QualityBudget(value)


def budget_text(budget: Budget) -> str:
    """Return a budget as it is typed."""
    if isinstance(budget, StepBudget):
        return f"{budget.steps}steps"
    return f"{budget.seconds:g}s" if isinstance(budget, TimeBudget) else f"{budget.psnr_db:g}dB"


@dataclass(frozen=True)
class TrainingSettings:
    """Settings of one training. The defaults are small and quick."""

    strategy: GroupingName = "clustered"
    clusters: int | None = None
    """Groups; None: as many as the grouping chooses."""
    texture_size: int = 256
    """Most texels of a texture along one side; smaller ones stay as they are."""
    recipe: RecipeName = "best"
    budget: Budget = DEFAULT_BUDGET
    codec: str | None = None
    """Codec of a pack from nothing. None: recipe and budget decide."""
    bits: float = DEFAULT_BITS
    """Bits per texel to come nearest to, of a pack from nothing, in a codec that is encoded to a target."""

    @property
    def codec_kind(self) -> str:
        """Name of the codec: the one that is asked for, else the first that has recipe and budget."""
        steps = self.budget.steps if isinstance(self.budget, StepBudget) else None
        return self.codec or chosen_codec(EncodingChoices(self.recipe, steps))

    @property
    def choices(self) -> EncodingChoices:
        """Choices for the codec."""
        target = None if codec_named(self.codec_kind).default_target is None else BitsTarget(self.bits)
        return EncodingChoices(self.recipe, target=target)

    @property
    def grouping_text(self) -> str:
        """`clustered`, `clustered k=4`."""
        return self.strategy if self.clusters is None else f"{self.strategy} k={self.clusters}"


def read_clusters(text: str) -> int | None:
    """Return the number of groups; None for `auto`. Raises InputError."""
    if text == AUTO:
        return None
    if not text.isdecimal() or not 1 <= int(text) <= MOST_CLUSTERS:
        raise InputError(f"k {text!r}: must be a whole number from 1, or {AUTO}")
    return int(text)
