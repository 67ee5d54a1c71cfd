"""Budgets of `ntc-viewer check`: limits of measured values in a TOML file, with exceptions.

The limit of a value is the most specific one that the budget has:

- of a pack or a view: its table `pack` or `view`;
- of a texture or a map: the last rule of `name` whose pattern fits the texture or one of its materials and that has this limit,
  then the table `map.MAP`, then the table `textures`.

An exception names a pattern, a reason and its last day. Until then, findings that it covers do not fail the check.
"""

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
    """Table of a budget. Unknown keys are refused, because a mistyped limit would have no effect."""


class TextureLimits(_Strict, frozen=True):
    """Limits of each texture and each of its maps."""

    psnr_db: Amount | None = None
    normal_degrees: Amount | None = None
    bits_per_texel: Amount | None = None
    bytes: Amount | None = None


class NamedLimits(TextureLimits, frozen=True, kw_only=True):
    """Limits of textures whose name, or the name of one of their materials, fits a pattern."""

    pattern: Pattern
    maps: tuple[MapName, ...] = ()
    """Maps that are limited; empty: all."""


class PackLimits(_Strict, frozen=True):
    """Limits of all packs together."""

    disk_bytes: Amount | None = None
    gpu_bytes: Amount | None = None
    bits_per_texel: Amount | None = None
    multiply_adds: Amount | None = None


class ViewLimits(_Strict, frozen=True):
    """Limits of each measured picture."""

    psnr_db: Amount | None = None
    flip: Amount | None = None
    divergence: Amount | None = None
    ssimulacra2: Annotated[float, msgspec.Meta(ge=-1000.0, le=100.0)] | None = None
    jod: Amount | None = None


class Waiver(_Strict, frozen=True):
    """Exception: subjects that may exceed their limits until a date."""

    pattern: Pattern
    reason: Annotated[str, msgspec.Meta(min_length=1, max_length=2000)]
    until: datetime.date
    """Last day of the exception."""
    maps: tuple[MapName, ...] = ()
    measures: tuple[MeasureName, ...] = ()
    """Measures that the exception covers; empty: all."""

    def covers(self, subject: Subject, measure: MeasureName) -> bool:
        """Return whether the exception covers this value, on any date."""
        return (
            _fits(self.pattern, subject)
            and (not self.maps or subject.map in self.maps)
            and (not self.measures or measure in self.measures)
        )


class Budget(_Strict, frozen=True):
    """Limits of all measured values. The most specific limit of a map holds: `name`, then `map`, then `textures`."""

    textures: TextureLimits = TextureLimits()
    map: dict[MapName, TextureLimits] = {}
    name: Annotated[tuple[NamedLimits, ...], msgspec.Meta(max_length=MOST_RULES)] = ()
    """Rules by pattern. Of several that fit, the last one with the limit holds."""
    pack: PackLimits = PackLimits()
    view: ViewLimits = ViewLimits()
    exception: Annotated[tuple[Waiver, ...], msgspec.Meta(max_length=MOST_RULES)] = ()
    worse: dict[MeasureName, Amount] = {}
    """Largest allowed loss against the accepted record, by measure; for bytes and bits as a share."""

    def limit(self, subject: Subject, measure: MeasureName) -> float | None:
        """Return the limit of a value; None where there is none."""
        if subject.kind in ("pack", "view"):
            limits = self.pack if subject.kind == "pack" else self.view
            limit: float | None = getattr(limits, measure, None)
            return limit
        for rule in reversed(self.name):
            fits = _fits(rule.pattern, subject) and (not rule.maps or subject.map in rule.maps)
            if fits and getattr(rule, measure, None) is not None:
                return float(getattr(rule, measure))
        general = [self.textures] if subject.map is None else [self.map.get(subject.map, self.textures), self.textures]
        return next((value for each in general if (value := getattr(each, measure, None)) is not None), None)

    def allowed_loss(self, measure: MeasureName) -> float:
        """Return the largest allowed loss of a value against the accepted one, in the unit of `Measure.worse`."""
        allowed = self.worse.get(measure)
        return MEASURES[measure].worse if allowed is None else float(allowed)


def _fits(pattern: str, subject: Subject) -> bool:
    """Return whether the name of the subject or of one of its materials fits a shell pattern; case is ignored."""
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
"""Ratio of a suggested limit to the worst value, by whether higher is better."""


def suggested_budget(record: Record) -> str:
    """Return a budget as TOML that `record` meets with a margin of 2 %: limits by kind of map, of views and of the packs."""
    worst: dict[str, dict[MeasureName, float]] = {}
    for subject, values in measured(record):
        table = {"map": f"map.{subject.map}", "texture": "textures"}.get(subject.kind, subject.kind)
        worst_of_table = worst.setdefault(table, {})
        for name, value in values.items():
            better = min if MEASURES[name].higher_is_better else max
            worst_of_table[name] = better(worst_of_table.get(name, value), value)
    lines = [
        f"# Limits that {printable(record.source)} met on {record.date[:10]}.",
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
