"""Settings of a training in the window with their defaults, and how the user types them."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal, get_args

from ntc.codec.config import GroupingName
from ntc.codec.encoding import (
    BitsTarget,
    Budget,
    EncodingChoices,
    QualityBudget,
    QualityTarget,
    RecipeName,
    SizeTarget,
    StepBudget,
    Target,
    TimeBudget,
)
from ntc.codec.model import Pack
from ntc.codec.registry import MODULES, SUMMARIES, chosen_codec, codec_named
from ntc.errors import InputError
from viewer.scene.json_text import counted
from viewer.scene.source_textures import MapChoice
from viewer.state.setting import Arg, field_args

BudgetUnit = Literal["steps", "s", "dB"]
BUDGET_UNITS: tuple[BudgetUnit, ...] = get_args(BudgetUnit)
LARGEST_BUDGETS: dict[BudgetUnit, float] = {"steps": 10_000_000, "s": 7 * 24 * 3600.0, "dB": 60.0}
SIZES = (4, 16384)
"""Least and most texels along one side."""
MOST_CLUSTERS = 100_000
DEFAULT_BUDGET = TimeBudget(30.0)
AUTO = "auto"
"""The number of groups where the grouping is to choose it; the codec where recipe and budget are to."""
ALL, WORST = "all", "worst"
"""Typed groups: every one, and the one with the texture of lowest PSNR."""
FULL = "full"
"""Typed size of textures that are not reduced."""
TargetUnit = Literal["bits", "dB", "MB"]
TARGET_UNITS: tuple[TargetUnit, ...] = get_args(TargetUnit)
TARGET_RANGES: Final[Mapping[TargetUnit, tuple[float, float]]] = MappingProxyType(
    {"bits": (0.01, 1000.0), "dB": (1.0, 58.9), "MB": (0.001, 1e6)}
)
"""What can be asked for; what can be reached depends on the textures."""
TARGET_TEXTS: Final[Mapping[TargetUnit, str]] = MappingProxyType(
    {
        "bits": "bits per texel of mip 0, all maps, mips and tables included",
        "dB": "least PSNR of each texture in dB, up to 58.9, in as few bits as possible",
        "MB": "largest file size in MB (10^6 bytes)",
    }
)
"""Targets by their unit."""


def parse_budget(text: str) -> Budget:
    """Return the budget written as `500steps`, `30s` or `35dB`. Raises InputError."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(steps|s|dB)\s*", text, re.IGNORECASE)
    if match is None:
        raise InputError(f"budget {text!r}: must be steps, seconds or a PSNR: 500steps, 30s or 35dB")
    return make_budget(float(match[1]), next(unit for unit in BUDGET_UNITS if unit.lower() == match[2].lower()))


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


def make_target(value: float, unit: TargetUnit) -> Target:
    """Return a target in a unit. Raises InputError for a value out of range."""
    low, high = TARGET_RANGES[unit]
    if not low <= value <= high:
        raise InputError(f"target {value:g} {unit}: must be {low:g} to {high:g} {unit}")
    if unit == "bits":
        return BitsTarget(value)
    return QualityTarget(value) if unit == "dB" else SizeTarget(value)


def parse_target(text: str) -> Target | None:
    """Return the target written as `4bits` or `4`, `40dB` or `2.8MB`; None for `auto`. Raises InputError."""
    if text == AUTO:
        return None
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(bits|dB|MB)?\s*", text, re.IGNORECASE)
    if match is None:
        raise InputError(f"target {text!r}: must be bits per texel, a PSNR or a file size: 4bits, 40dB or 2.8MB")
    unit = (match[2] or "bits").lower()
    return make_target(float(match[1]), next(each for each in TARGET_UNITS if each.lower() == unit))


def target_parts(target: Target) -> tuple[float, TargetUnit]:
    """Return a target as (value, unit)."""
    if isinstance(target, BitsTarget):
        return target.bits, "bits"
    return (target.psnr_db, "dB") if isinstance(target, QualityTarget) else (target.megabytes, "MB")


def target_text(target: Target | None, spaced: bool = False) -> str:
    """Return a target as it is typed, or with a space as a person reads it."""
    if target is None:
        return AUTO
    value, unit = target_parts(target)
    return f"{value:g}{' ' if spaced else ''}{unit}"


def read_clusters(text: str) -> int | None:
    """Return the number of groups; None for `auto`. Raises InputError."""
    if text == AUTO:
        return None
    if not text.isdecimal() or not 1 <= int(text) <= MOST_CLUSTERS:
        raise InputError(f"groups {text!r}: must be a whole number from 1, or {AUTO}")
    return int(text)


def read_size(text: str) -> int | None:
    """Return the largest texture size in texels; None for `full`. Raises InputError."""
    if text == FULL:
        return None
    low, high = SIZES
    if not text.isdecimal() or not low <= int(text) <= high:
        raise InputError(f"size {text!r}: must be {low} to {high} texels, or {FULL}")
    return int(text)


def read_number(text: str, what: str, most: int) -> int:
    """Return a number from 0 to `most`. Raises InputError that says `what` it is of."""
    if not text.isdecimal() or int(text) > most:
        raise InputError(f"{what} {text!r}: must be a whole number from 0 to {most}")
    return int(text)


def read_groups(text: str, pack: Pack) -> frozenset[int]:
    """Return the groups of a pack that are written as `0,3,5`, `all` or `worst`. Raises InputError."""
    count = pack.grouping.group_count
    if text == ALL:
        return frozenset(range(count))
    if text == WORST:
        known = [(texture.psnr_db, texture.group) for texture in pack.textures if texture.psnr_db is not None]
        if not known:
            raise InputError("groups: the PSNR of this pack is unknown; name the groups")
        return frozenset({min(known, key=lambda entry: entry[0])[1]})
    parts = text.replace(",", " ").split()
    if not parts:
        raise InputError(f"groups {text!r}: name some, as in 0,3,5")
    return frozenset(read_number(part, "group", count - 1) for part in parts)


def read_texture(text: str, pack: Pack) -> int:
    """Return the number of a pack's texture that is written as its name or number. Raises InputError."""
    names = [texture.name for texture in pack.textures]
    if text in names:
        return names.index(text)
    if not text.isdecimal():
        raise InputError(f"texture {text!r}: the pack has no such texture; give its name, or its number from 0")
    return read_number(text, "texture", len(names) - 1)


def _auto(text: str) -> str | None:
    return None if text == AUTO else text


def _read_only(text: str) -> frozenset[int] | None:
    parts = text.replace(",", " ").split()
    if text in (AUTO, "all"):
        return None
    if not parts or not all(part.isdecimal() for part in parts):
        raise InputError(f"textures {text!r}: must be numbers of textures such as 0,3,5, or all")
    return frozenset(map(int, parts))


@dataclass(frozen=True)
class TrainingSettings:
    """Settings of one training. The defaults are those of `ntc-viewer encode`."""

    strategy: Annotated[
        GroupingName,
        Arg("grouping: which textures share a decoder", lambda _session: get_args(GroupingName), name="grouping"),
    ] = "clustered"
    clusters: Annotated[
        int | None,
        Arg(
            "number of groups for clustered, random and covisible; under universal with whole materials the upper limit",
            name="groups",
            read=read_clusters,
        ),
    ] = None
    """Groups; None: as many as the grouping chooses."""
    texture_size: Annotated[
        int | None,
        Arg(
            "largest side of a texture in texels; larger ones are reduced first",
            name="size",
            offers=(64, 128, 256, 512, 1024, 2048, 4096),
            read=read_size,
        ),
    ] = None
    """Most texels of a texture along one side; smaller ones stay as they are. None: full size."""
    recipe: Annotated[
        RecipeName,
        Arg(
            "recipe of codec grid. best: the fastest training to good quality; paper: as in the paper",
            lambda _session: get_args(RecipeName),
        ),
    ] = "best"
    budget: Annotated[
        Budget,
        Arg(
            "length of a training: 30s, 500steps, or 35dB to reach",
            names={"s": "seconds", "steps": "steps", "dB": "dB PSNR"},
            read=parse_budget,
        ),
    ] = DEFAULT_BUDGET
    codec: Annotated[
        str | None,
        Arg(
            " ".join(f"{name}: {summary}" for name, summary in SUMMARIES.items()),
            lambda _session: (AUTO, *MODULES),
            read=_auto,
        ),
    ] = None
    """Codec of a pack from nothing. None: recipe and budget decide."""
    target: Annotated[
        Target | None,
        Arg(
            "what to reach: 4bits (per texel), 40dB (each texture) or 2.8MB (file)",
            names={"bits": "bits per texel", "dB": "dB at least", "MB": "MB in all"},
            values=TARGET_TEXTS,
            read=parse_target,
        ),
    ] = None
    """Target of a pack from nothing, in a codec that takes one. None: what the codec takes for these maps."""
    maps: Annotated[
        MapChoice | None,
        Arg(
            "maps to encode. all: whole materials, the maps of each together; base: base colours",
            lambda _session: (AUTO, *get_args(MapChoice)),
            names={"all": "whole materials", "base": "base colours"},
            read=_auto,
        ),
    ] = None
    """Whole materials or base colours alone; None: what the codec takes."""
    only: Annotated[
        frozenset[int] | None,
        Arg("textures to encode: all, or numbers such as 0,3,5", name="textures", read=_read_only),
    ] = None
    """Ids of the scene's textures to encode; None: all."""

    @property
    def codec_kind(self) -> str:
        """Name of the codec: the one that is asked for, else the first that has recipe and budget."""
        steps = self.budget.steps if isinstance(self.budget, StepBudget) else None
        return self.codec or chosen_codec(EncodingChoices(self.recipe, steps))

    @property
    def chosen_maps(self) -> MapChoice:
        """Maps to encode."""
        return self.maps or codec_named(self.codec_kind).default_maps

    @property
    def choices(self) -> EncodingChoices:
        """Choices for the codec."""
        takes_target = codec_named(self.codec_kind).default_target is not None
        return EncodingChoices(self.recipe, target=self.target if takes_target else None)

    @property
    def grouping_text(self) -> str:
        """`clustered`, `clustered, 4 groups`."""
        fixed = self.clusters is None or self.strategy in ("baseline", "single", "category")
        return self.strategy if fixed else f"{self.strategy}, {counted(self.clusters or 0, 'group')}"


SETTINGS: Final[Mapping[str, tuple[str, Arg]]] = MappingProxyType(
    {arg.name or field: (field, arg) for field, arg in field_args(TrainingSettings).items()}
)
"""Field of TrainingSettings and its description, by the name that the user types."""


def with_setting(settings: TrainingSettings, name: str, text: str) -> TrainingSettings:
    """Return `settings` with one value as it is typed; `name` is one of SETTINGS. Raises InputError for a value that is wrong."""
    field, arg = SETTINGS[name]
    choices = arg.choices(None) if arg.choices is not None else ()
    if choices and text not in choices:
        raise InputError(f"{name} {text!r}: must be one of {', '.join(choices)}")
    value: Any = arg.read(text) if arg.read is not None else text
    changed = replace(settings, **{field: value})
    if name == "codec" and changed.codec is not None and not codec_named(changed.codec).trains:
        # Recipes and steps are for codecs that train.
        budget = DEFAULT_BUDGET if isinstance(changed.budget, StepBudget) else changed.budget
        changed = replace(changed, recipe=TrainingSettings.recipe, budget=budget)
    return changed
