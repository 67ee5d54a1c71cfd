"""Study of rate and distortion on a set of textures. Every codec and setting is one step."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from lab.runner import Report
from lab.studies.block_codec import measured_block_codec
from lab.studies.disk_formats import DISTANCES, TITLES, disk_file, has_jpeg_xl, jpeg_xl_files, measured_files
from lab.studies.hardware_formats import FormatStudy
from lab.studies.rate_table import RatePoint
from lab.studies.runs import Run, finished_run
from lab.studies.set_quality import PictureQuality, SetQuality
from lab.studies.settings import QUALITIES, BlockSide, DiskFormat
from ntc.codec.grid.training.config import TrainingConfig, recipe_codec, recipe_for_length
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.metrics.block_compression import BlockFormat

Step = Callable[[Report], RatePoint]
GRID_SETTINGS = ((4, 4), (8, 4), (16, 4), (16, 8))
"""Settings (latent channels, bits of each) of codec `grid`: 1, 2, 4 and 8 bits per texel without decoders and adapters."""
FARTHEST = 0.25
"""Largest deviation from the requested bitrate, as a share of it. Points with a larger deviation are left out."""


@dataclass(frozen=True, eq=False)
class RateStudy:
    """Settings of the study, and the folders of its cached results."""

    textures: Sequence[SourceTexture]
    groupings: Sequence[Grouping]
    """Groupings of codec `block`; the first is also that of codec `grid`."""
    sides: Sequence[BlockSide]
    """Sides of the blocks of codec `block`, in texels."""
    bits: Sequence[float]
    formats: Sequence[BlockFormat]
    grid_steps: int
    disk_formats: Sequence[DiskFormat]
    jpeg_xl: bool
    flip_every: int
    runs: Path
    cache: Path
    """Folder of the cached figures of block formats."""

    def steps(self) -> list[tuple[str, Step]]:
        """Return (name, step) of every point. A step raises InputError where its point cannot be measured."""
        steps: list[tuple[str, Step]] = [(name, partial(self._format, name)) for name in self.formats]
        for disk_format in self.disk_formats:
            steps += [
                (f"{TITLES[disk_format]} {quality}", partial(self._disk, disk_format, quality))
                for quality in QUALITIES[disk_format]
            ]
        for distance in DISTANCES if self.jpeg_xl else ():
            steps.append((f"JPEG XL {distance:g}", partial(self._jpeg_xl, distance)))
        for grouping in self.groupings:
            for side in self.sides:
                name = f"block {side}x{side}, {grouping.name}"
                steps += [
                    (f"{name}, {bits:g} bits", partial(self._block, name, grouping, side, bits)) for bits in self.bits
                ]
        for channels, latent_bits in GRID_SETTINGS if self.grid_steps else ():
            steps.append((f"grid {channels}x{latent_bits}", partial(self._grid, channels, latent_bits)))
        return steps

    def _format(self, name: BlockFormat, report: Report) -> RatePoint:
        _, quality = FormatStudy(self.cache).measured(self.textures, name, report, self.flip_every)
        return RatePoint("ASTC" if name.startswith("astc") else name.upper(), name, quality)

    def _disk(self, name: DiskFormat, quality: int, report: Report) -> RatePoint:
        encode = partial(disk_file, name=name, quality=quality)
        return RatePoint(
            TITLES[name], f"quality {quality}", measured_files(self.textures, encode, self.flip_every, report)
        )

    def _jpeg_xl(self, distance: float, report: Report) -> RatePoint:
        if not has_jpeg_xl():
            raise InputError("this build of OpenImageIO does not write JPEG XL")
        encode = partial(jpeg_xl_files, distance=distance)
        quality = measured_files(self.textures, encode, self.flip_every, report)
        return RatePoint("JPEG XL", f"distance {distance:g}", quality)

    def _block(self, name: str, grouping: Grouping, side: BlockSide, bits: float, _report: Report) -> RatePoint:
        quality = measured_block_codec(self.textures, grouping, bits, self.flip_every, side)
        if abs(quality.bits_per_texel - bits) > FARTHEST * bits:
            raise InputError(f"the nearest bitrate is {quality.bits_per_texel:.2f} bits per texel")
        return RatePoint(name, f"{bits:g} bits", quality)

    def _grid(self, channels: int, latent_bits: int, report: Report) -> RatePoint:
        output_channels = max(texture.pixels.shape[2] for texture in self.textures)
        codec = recipe_codec("best", output_channels, None)
        codec = replace(codec, latent_channels=channels, latent_bits=latent_bits)  # type: ignore[arg-type]
        training = recipe_for_length("best", TrainingConfig(steps=self.grid_steps, texels_per_texture=512))
        run = Run(f"grid {channels}x{latent_bits}", self.groupings[0], codec, training, pictures=True)
        result = finished_run(run, self.textures, self.runs, report)
        rows = zip(result.psnr_db, result.ssim, result.flip, strict=True)
        pictures = [
            PictureQuality(
                float("inf") if psnr is None else psnr, ssim, flip if number % self.flip_every == 0 else None
            )
            for number, (psnr, ssim, flip) in enumerate(rows)
        ]
        quality = SetQuality.of(pictures, result.bits_per_texel, result.seconds)
        setting = f"{channels} channels of {latent_bits} bits, {self.grid_steps} steps"
        return RatePoint(f"grid, {self.groupings[0].name}", setting, quality)
