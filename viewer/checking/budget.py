"""Budgets: limits of measured values in a TOML file, with exceptions that carry a reason and an end date."""

import datetime
import fnmatch
import math
import tomllib
from pathlib import Path
from typing import Annotated

import msgspec

from ntc.codec.maps import MapName
from ntc.errors import InputError
from ntc.io import read_file
from viewer.checking.record import MEASURES, MeasureName, Record, Subject, measured
from viewer.scene.json_text import convert, printable

LARGEST_BUDGET = 1 << 20
"""Bytes of the largest budget that is read."""
MOST_RULES = 10_000
REMEDY = "correct it, or write one with ntc-viewer check --suggest FILE"

Amount = Annotated[float, msgspec.Meta(ge=0.0, le=1e15)]
Pattern = Annotated[str, msgspec.Meta(min_length=1, max_length=500)]


class _Strict(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Table of a budget; unknown keys are refused, for a mistyped limit limits nothing."""


class TextureLimits(_Strict, frozen=True):
    """Limits of textures and their maps."""

    psnr_db: Amount | None = None
    normal_degrees: Amount | None = None
    bits_per_texel: Amount | None = None
    bytes: Amount | None = None


class NamedLimits(TextureLimits, frozen=True, kw_only=True):
    """Limits of the textures whose name, or whose material's name, fits a pattern."""

    pattern: Pattern
    maps: tuple[MapName, ...] = ()
    """Maps that the limits are for; empty: all."""


class PackLimits(_Strict, frozen=True):
    """Limits of all packs together."""

    disk_bytes: Amount | None = None
    gpu_bytes: Amount | None = None
    bits_per_texel: Amount | None = None
    multiply_adds: Amount | None = None


class ViewLimits(_Strict, frozen=True):
    """Limits of pictures."""

    psnr_db: Amount | None = None
    flip: Amount | None = None
    divergence: Amount | None = None
    ssimulacra2: Annotated[float, msgspec.Meta(ge=-1000.0, le=100.0)] | None = None
    jod: Amount | None = None


class Waiver(_Strict, frozen=True):
    """Exception: subjects that may pass their limits until a date."""

    pattern: Pattern
    reason: Annotated[str, msgspec.Meta(min_length=1, max_length=2000)]
    until: datetime.date
    """Last day on which the exception holds."""
    maps: tuple[MapName, ...] = ()
    measures: tuple[MeasureName, ...] = ()
    """Measures that the exception is for; empty: all."""

    def covers(self, subject: Subject, measure: MeasureName) -> bool:
        """Return whether the exception is about this value, whatever the date."""
        return (
            _fits(self.pattern, subject)
            and (not self.maps or subject.map in self.maps)
            and (not self.measures or measure in self.measures)
        )


class Budget(_Strict, frozen=True):
    """A whole budget. Of the limits for a map the most particular one holds: `name`, then `map`, then `textures`."""

    textures: TextureLimits = TextureLimits()
    map: dict[MapName, TextureLimits] = {}
    name: Annotated[tuple[NamedLimits, ...], msgspec.Meta(max_length=MOST_RULES)] = ()
    """Of several that fit, the last that has the limit holds."""
    pack: PackLimits = PackLimits()
    view: ViewLimits = ViewLimits()
    exception: Annotated[tuple[Waiver, ...], msgspec.Meta(max_length=MOST_RULES)] = ()
    worse: dict[MeasureName, Amount] = {}
    """Change for the worse that counts against the accepted record, by measure; shares for bytes and bits."""

    def limit(self, subject: Subject, measure: MeasureName) -> float | None:
        """Return the limit of a value; None where there is none."""
        if subject.kind in ("pack", "view"):
            own = self.pack if subject.kind == "pack" else self.view
            found: float | None = getattr(own, measure, None)
            return found
        for rule in reversed(self.name):
            fits = _fits(rule.pattern, subject) and (not rule.maps or subject.map in rule.maps)
            if fits and getattr(rule, measure, None) is not None:
                return float(getattr(rule, measure))
        general = [self.textures] if subject.map is None else [self.map.get(subject.map, self.textures), self.textures]
        return next((value for each in general if (value := getattr(each, measure, None)) is not None), None)

    def allowed_loss(self, measure: MeasureName) -> float:
        """Return by how much a value may be worse than the accepted one, in the unit of `Measure.worse`."""
        own = self.worse.get(measure)
        return MEASURES[measure].worse if own is None else float(own)


def _fits(pattern: str, subject: Subject) -> bool:
    """Return whether the subject's name, or that of one of its materials, fits a shell pattern, upper and lower case alike."""
    return any(fnmatch.fnmatch(name.casefold(), pattern.casefold()) for name in (subject.name, *subject.materials))


def read_budget(path: Path) -> Budget:
    """Return the budget in the TOML file at `path`. Raises InputError, one line that names file, field and remedy."""
    try:
        data = read_file(path, LARGEST_BUDGET)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); {REMEDY}") from error
    try:
        content = tomllib.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not valid TOML ({printable(str(error))}); {REMEDY}") from error
    return convert(content, Budget, str(path), REMEDY)


ROOM = {True: 0.98, False: 1.02}
"""Factor of suggested limits on the worst value, by whether higher is better."""


def suggested_budget(record: Record) -> str:
    """Return a budget as TOML that `record` just keeps: limits by kind of map, of views and of the packs."""
    worst: dict[str, dict[MeasureName, float]] = {}
    for subject, values in measured(record):
        table = {"map": f"map.{subject.map}", "texture": "textures"}.get(subject.kind, subject.kind)
        own = worst.setdefault(table, {})
        for name, value in values.items():
            better = min if MEASURES[name].higher_is_better else max
            own[name] = better(own.get(name, value), value)
    lines = [
        f"# Limits that {printable(record.source)} kept on {record.date[:10]}.",
        "# docs/guide/check.md explains all tables.",
    ]
    for table, limits in sorted(worst.items(), key=lambda item: (item[0] != "textures", item[0])):
        chosen = {name: value for name, value in limits.items() if not (table == "textures" and name == "bytes")}
        if chosen:
            lines += ["", f"[{table}]", *(_line(name, value) for name, value in chosen.items())]
    return "\n".join(lines) + "\n"


def _line(name: MeasureName, value: float) -> str:
    measure = MEASURES[name]
    if measure.digits == 0:
        return f"{name} = {math.ceil(value * ROOM[False])}"
    step = 10.0**measure.digits
    rounded = (math.floor if measure.higher_is_better else math.ceil)(
        value * ROOM[measure.higher_is_better] * step
    ) / step
    return f"{name} = {rounded:.{measure.digits}f}"
