"""Rate curves: the quality of a texture by its bitrate, measured in the background, and forecasts of whole encodings.

A part of the texture is encoded, in a helper process, at a few bitrates.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from ntc.codec.encoding import (
    BitsTarget,
    EncodingChoices,
    QualityTarget,
    SizeTarget,
    Target,
    TextureSet,
    TimeBudget,
    texture_set,
)
from ntc.codec.maps import MapName
from ntc.codec.model import Grouping
from ntc.codec.quality import mse_of_psnr, psnr_of_mse
from ntc.codec.registry import codec_named
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.metrics.metrics import bits_with_mips
from ntc.worker.helpers import HELPERS
from viewer.jobs.job import Job, JobReport
from viewer.scene.images import reduced_size
from viewer.scene.json_text import counted
from viewer.scene.model import Scene
from viewer.scene.source_textures import MapChoice, has_source, source_texture
from viewer.training.settings import TrainingSettings

RATE_CODEC = "block"
"""Codec whose curves are measured: the one that is encoded to a target."""
CURVE_BITS = (4.0, 8.0, 2.0, 16.0, 1.0)
"""Bits per texel of the points of a curve, the most telling one first."""
PART_SIDE, TILE_SIDE = 384, 64
"""Sides in texels of the part of a texture that is encoded, and of its tiles, which are spread over the texture."""
EXACT_DB = 99.0
"""PSNR in dB that represents no error."""
TEXELS_OF_MINUTES = 1 << 27
"""Texels of all maps from which on an encoding in codec `block` takes minutes, on about two cores."""
SECONDS_OF_MINUTES = 60.0
"""Budget in seconds from which on a training takes minutes."""
MOST_SAMPLED = 4
"""Textures that a forecast measures, the largest first."""


@dataclass(frozen=True)
class RatePoint:
    """Result of encoding a part of a texture."""

    bits: float
    """Stored bits per texel of mip 0, mips and tables included."""
    psnr_db: float
    """PSNR of mip 0 in dB, all maps together; EXACT_DB where it is exact."""
    by_map: Mapping[MapName, float]
    """PSNR in dB by map; EXACT_DB where it is exact."""
    normal_degrees: float | None = None
    """Mean angle in degrees between decoded and original normals."""
    latent_bits: float = 0.0
    """Bits per texel of mip 0 without tables: what the texture takes for itself."""


@dataclass(frozen=True)
class RateCurve:
    """Quality of one texture by its bits."""

    points: tuple[RatePoint, ...]
    """By rising bits; at least one."""
    texels: int
    """Texels of mip 0."""

    def of_map(self, name: MapName) -> "RateCurve":
        """Return the curve of one map. Raises KeyError for a map that the texture lacks."""
        return replace(self, points=tuple(replace(p, psnr_db=p.by_map[name]) for p in self.points))

    def of_latents(self) -> "RateCurve":
        """Return the curve by the bits that the texture takes for itself, without tables."""
        return replace(self, points=tuple(replace(p, bits=p.latent_bits) for p in self.points if p.latent_bits > 0.0))

    def through(self, bits: float, psnr_db: float) -> "RateCurve":
        """Return the curve moved up or down, so that it has `psnr_db` at `bits`: what the whole texture was measured to have."""
        more = psnr_db - self.psnr_at(bits)
        return replace(self, points=tuple(replace(p, psnr_db=p.psnr_db + more) for p in self.points))

    def normals_at(self, bits: float) -> float | None:
        """Return the mean angle of normals in degrees at `bits` bits per texel; None where it is not known."""
        known = [(math.log2(p.bits), math.log2(p.normal_degrees)) for p in self.points if p.normal_degrees]
        if len(known) < 2:
            return None
        return float(2.0 ** _interpolated([x for x, _ in known], [y for _, y in known], math.log2(bits)))

    def psnr_at(self, bits: float) -> float:
        """Return the PSNR in dB at `bits` bits per texel: between points by the logarithm of bits, beyond them straight on."""
        return _interpolated(
            [math.log2(p.bits) for p in self.points], [p.psnr_db for p in self.points], math.log2(bits)
        )

    def bits_at(self, psnr_db: float) -> float:
        """Return the bits per texel at which the texture has a PSNR in dB."""
        logarithm = _interpolated([p.psnr_db for p in self.points], [math.log2(p.bits) for p in self.points], psnr_db)
        return float(2.0 ** min(logarithm, 6.0))

    def megabytes(self, bits: float) -> float:
        """Return the size in MB of the texture at `bits` bits per texel."""
        return bits * self.texels / 8e6


def point_text(curve: RateCurve, bits: float) -> str:
    """Return what `bits` bits per texel give: `7.2 bits: 40.0 dB, 1.1 MB, normals 1.2 deg`."""
    degrees = curve.normals_at(bits)
    normals = "" if degrees is None else f", normals {degrees:.1f} deg"
    return f"{bits:.1f} bits: {curve.psnr_at(bits):.1f} dB, {size_text(curve.megabytes(bits))}{normals}"


def size_text(megabytes: float) -> str:
    """Return a size with its unit: `1.1 MB`, `240 kB`."""
    return f"{megabytes:.1f} MB" if megabytes >= 1.0 else f"{1e3 * megabytes:.0f} kB"


SLOPE_DB = 4.4
"""Rise in dB for twice the bits where a curve has one point."""


def _interpolated(xs: Sequence[float], ys: Sequence[float], x: float) -> float:
    """Piecewise linear through points of rising x, straight on beyond them."""
    if len(xs) == 1:
        # One point is of (log2 bits, dB) or (dB, log2 bits).
        slope = SLOPE_DB if abs(ys[0]) > abs(xs[0]) else 1.0 / SLOPE_DB
        return ys[0] + (x - xs[0]) * slope
    right = min(max(int(np.searchsorted(xs, x)), 1), len(xs) - 1)
    left = right - 1
    share = (x - xs[left]) / max(xs[right] - xs[left], 1e-9)
    return ys[left] + share * (ys[right] - ys[left])


@dataclass(frozen=True, eq=False)
class PointJob:
    """A part of a texture to encode, and how."""

    part: SourceTexture
    whole: TextureSet
    """The texture that the part is of: its size decides about tables."""
    bits: float


def rate_point(job: PointJob) -> RatePoint:
    """Return the point of a curve, in a helper. Raises InputError for bits out of reach."""
    from ntc.training.encode import encode_textures

    codec, choices = codec_named(RATE_CODEC), EncodingChoices(target=BitsTarget(job.bits))
    settings = codec.settings_for(job.whole, choices)
    options = codec.live_options_for(choices)
    pack = encode_textures([job.part], Grouping("baseline", (0,)), settings, options)
    (texture,) = pack.textures
    known = zip(texture.maps, texture.map_psnr_db or (texture.psnr_db,), strict=True)
    latent_bits = 8.0 * codec.texture_bytes(texture, settings).latents / (texture.width * texture.height)
    # The tables are those of the whole texture.
    share = texture.width * texture.height / sum(width * height for width, height in job.whole.sizes)
    return RatePoint(
        latent_bits + share * (bits_with_mips(pack) - latent_bits),
        min(texture.psnr_db or 0.0, EXACT_DB),
        {name: min(psnr, EXACT_DB) for name, psnr in known if psnr is not None},
        texture.normal_degrees[0] if texture.normal_degrees is not None else None,
        latent_bits,
    )


def part_of(texture: SourceTexture, side: int = PART_SIDE, tile: int = TILE_SIDE) -> SourceTexture:
    """Return tiles of `texture` that are spread evenly over it, `side` x `side` texels together; a small texture as it is."""
    width, height = texture.size
    if width * height <= side * side or min(width, height) < side:
        return texture
    count = side // tile
    rows, columns = (
        [round((index + 0.5) * (length // tile) / count - 0.5) * tile for index in range(count)]
        for length in (height, width)
    )
    parts = [[texture.pixels[y : y + tile, x : x + tile] for x in columns] for y in rows]
    return replace(texture, pixels=np.concatenate([np.concatenate(row, axis=1) for row in parts]))


@dataclass(frozen=True)
class Forecast:
    """Forecast of the result of an encoding."""

    textures: int
    maps: int
    size: tuple[int, int]
    """Width and height in texels of the largest texture."""
    same_size: bool
    time: Literal["seconds", "minutes"]
    """Order of the time of encoding."""
    megabytes: float | None = None
    psnr_db: float | None = None
    bits: float | None = None

    def line(self) -> str:
        """Return `5 maps of 2048x2048 -> about 2.1 MB, about 39 dB, takes seconds`."""
        of = "" if self.same_size else "up to "
        what = f"{counted(self.maps, 'map')} of {of}{self.size[0]}x{self.size[1]}"
        parts = [
            f"about {self.megabytes:.2g} MB" if self.megabytes is not None and self.megabytes < 10 else "",
            f"about {self.megabytes:.0f} MB" if self.megabytes is not None and self.megabytes >= 10 else "",
            f"{self.bits:.1f} bits per texel" if self.bits is not None else "",
            f"about {self.psnr_db:.0f} dB" if self.psnr_db is not None else "",
            f"takes {self.time}",
        ]
        return f"{what} -> {', '.join(part for part in parts if part)}"


def chosen_textures(settings: TrainingSettings, scene: Scene) -> tuple[int, ...]:
    """Return the ids of the textures that an encoding of `scene` takes."""
    maps = settings.chosen_maps
    return tuple(
        index
        for index, texture in enumerate(scene.textures)
        if has_source(texture, maps) and (settings.only is None or index in settings.only)
    )


def sampled_textures(settings: TrainingSettings, scene: Scene) -> tuple[int, ...]:
    """Return the textures whose curves a forecast is made of: the largest that an encoding takes, the largest first."""
    ids = sorted(chosen_textures(settings, scene), key=lambda index: -math.prod(scene.textures[index].size))
    return tuple(ids[:MOST_SAMPLED])


class RateCurves:
    """Rate curves of the open scene's textures, and forecasts. Called from the window's thread; never waits."""

    def __init__(self) -> None:
        self.version = 0
        """Rises with each new point."""
        self._scene: Scene | None = None
        self._curves: dict[tuple[int, MapChoice], RateCurve] = {}
        self._problems: dict[tuple[int, MapChoice], str] = {}
        self._wanted: list[tuple[int, MapChoice]] = []
        self._asked: set[tuple[int, MapChoice]] = set()
        """Keys that were ever asked for in this scene."""
        self._ended: set[tuple[int, MapChoice]] = set()
        """Keys whose curves have all their points, or cannot be measured."""
        self._job: Job[None] | None = None
        self._key: tuple[int, MapChoice] | None = None
        self._forecasts: dict[TrainingSettings, Forecast | None] = {}
        self._forecast_for: tuple[object, ...] = ()
        """Facts that `_forecasts` follow from."""
        self._points = 0
        """Points of the job under way that were taken."""

    @property
    def is_busy(self) -> bool:
        """True while a curve is measured or waits."""
        return self._job is not None or bool(self._wanted)

    def curve(self, texture: int, maps: MapChoice = "all") -> RateCurve | None:
        """Return what is known so far of the curve of a texture of the open scene."""
        return self._curves.get((texture, maps))

    def problem(self, texture: int, maps: MapChoice = "all") -> str:
        """Return why a curve could not be measured; "" where it could or may be."""
        return self._problems.get((texture, maps), "")

    def want(self, scene: Scene, textures: Iterable[int], maps: MapChoice = "all") -> None:
        """Measure the curves of textures of `scene`, the last one asked for first. No effect where that was done."""
        self.enter(scene)
        for texture in textures:
            key = (texture, maps)
            if key not in self._asked:
                self._asked.add(key)
                self._wanted.append(key)

    def enter(self, scene: Scene) -> None:
        """Make `scene` the open one; curves of another are dropped."""
        if scene is self._scene:
            return
        self._scene = scene
        self._curves, self._problems, self._wanted, self._asked, self._ended = {}, {}, [], set(), set()
        self._stop()

    def _stop(self) -> None:
        """End the curve under way, and its helper, in the middle of its work."""
        if self._job is not None:
            self._job.cancel()
        self._job = self._key = None

    def tick(self, may_start: bool) -> None:
        """Take what is new, and begin the next curve where `may_start`. Otherwise a curve under way is put off: an encoding needs the
        processors."""
        job = self._job
        if job is not None:
            self._take(job)
        if not may_start and self._job is not None and self._key is not None:
            self._wanted.append(self._key)
            self._stop()
        if self._job is None and may_start and self._wanted and self._scene is not None:
            key = self._wanted.pop()
            self._key, self._points = key, 0
            self._job = Job(partial(self._measure, self._scene, *key)).start("rate curve")

    def _take(self, job: Job[None]) -> None:
        key = self._key
        assert key is not None
        partial_curve = job.report.partial
        if isinstance(partial_curve, RateCurve) and len(partial_curve.points) > self._points:
            self._points = len(partial_curve.points)
            self._curves[key] = partial_curve
            self.version += 1
        if job.done:
            if job.problem and key not in self._curves:
                self._problems[key] = job.problem
            self._ended.add(key)
            self._job = self._key = None
            self.version += 1

    @staticmethod
    def _measure(scene: Scene, texture: int, maps: MapChoice, report: JobReport) -> None:
        """Measure one curve, in a thread that waits for a helper."""
        source = source_texture(scene, texture, None, maps)
        whole, part = texture_set([source], 1), part_of(source)
        texels = source.size[0] * source.size[1]
        points: list[RatePoint] = []
        problem = ""
        for number, bits in enumerate(CURVE_BITS):
            report.progress(number, len(CURVE_BITS))
            try:
                points.append(HELPERS.call("rates", rate_point, PointJob(part, whole, bits), report.check))
            except InputError as error:
                problem = str(error)
                continue
            report.show(RateCurve(tuple(sorted(points, key=lambda point: point.bits)), texels))
        if not points:
            raise InputError(problem)

    def forecast(self, settings: TrainingSettings, scene: Scene) -> Forecast | None:
        """Return what an encoding of `scene` would give, as far as it is known; None where it has no textures."""
        known = (scene, self.version)
        if known != self._forecast_for:
            self._forecasts, self._forecast_for = {}, known
        if settings not in self._forecasts:
            self._forecasts[settings] = self._forecast(settings, scene)
        return self._forecasts[settings]

    def _forecast(self, settings: TrainingSettings, scene: Scene) -> Forecast | None:
        ids, maps = chosen_textures(settings, scene), settings.chosen_maps
        if not ids:
            return None
        sizes = [scene.textures[index].size for index in ids]
        if settings.texture_size is not None:
            sizes = [reduced_size(*size, settings.texture_size) for size in sizes]
        texels = [width * height for width, height in sizes]
        names = [scene.textures[index].maps if maps == "all" else ("base",) for index in ids]
        largest = max(sizes, key=lambda size: size[0] * size[1])
        map_texels = sum(count * len(maps_of_texture) for count, maps_of_texture in zip(texels, names, strict=True))
        forecast = Forecast(len(ids), sum(map(len, names)), largest, len(set(sizes)) == 1, _time(settings, map_texels))
        codec = codec_named(settings.codec_kind)
        target = settings.target or codec.target_of(max(names, key=len))
        curves = {index: curve for index in ids if (curve := self.curve(index, maps)) is not None}
        if not all((index, maps) in self._ended for index in sampled_textures(settings, scene)):
            # The first curves alone would promise too much or too little.
            curves = {}
        if target is not None:
            forecast = _with_target(forecast, target, curves, dict(zip(ids, texels, strict=True)))
        return forecast

    def close(self) -> None:
        """End the curve under way."""
        self._stop()


def _time(settings: TrainingSettings, texels: int) -> Literal["seconds", "minutes"]:
    """Return the order of the time of an encoding of so many texels of all maps."""
    if codec_named(settings.codec_kind).trains:
        budget = settings.budget
        return "seconds" if isinstance(budget, TimeBudget) and budget.seconds < SECONDS_OF_MINUTES else "minutes"
    return "seconds" if texels < TEXELS_OF_MINUTES else "minutes"


def _with_target(
    forecast: Forecast, target: Target, curves: Mapping[int, RateCurve], texels: Mapping[int, int]
) -> Forecast:
    """Return `forecast` with the size and quality of `target`. Textures without a curve count as the mean of the others."""
    all_texels = sum(texels.values())
    if isinstance(target, QualityTarget):
        if not curves:
            return replace(forecast, psnr_db=target.psnr_db)
        weighted = [curve.bits_at(target.psnr_db) * texels[index] for index, curve in curves.items()]
        bits = sum(weighted) / sum(texels[index] for index in curves)
        return replace(forecast, bits=bits, megabytes=bits * all_texels / 8e6, psnr_db=target.psnr_db)
    bits = target.bits if isinstance(target, BitsTarget) else 8e6 * target.megabytes / all_texels
    megabytes = target.megabytes if isinstance(target, SizeTarget) else bits * all_texels / 8e6
    errors = [mse_of_psnr(curve.psnr_at(bits)) for curve in curves.values()]
    psnr = psnr_of_mse(float(np.mean(errors))) if errors else None
    return replace(forecast, megabytes=megabytes, psnr_db=psnr, bits=None if isinstance(target, BitsTarget) else bits)
