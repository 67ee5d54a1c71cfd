"""Targets of an encoding: bits a texel, a file size, or a quality of every texture. Needs no torch."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from ntc.errors import InputError

PresetName = Literal["1bit", "2bit", "4bit", "8bit", "fast"]
HIGHEST_QUALITY_DB = 58.9
"""PSNR of errors spread evenly over an 8-bit step: beyond it, only exact values are nearer."""


@dataclass(frozen=True)
class BitsTarget:
    """So many stored bits a texel of all mips, or the nearest that is possible."""

    bits: float
    block_side: Literal[4, 8] = 8
    multiply_adds: int | None = None
    """Of one texel, at most; None: as many as it takes."""
    preset: PresetName | None = None
    """The preset that stands for it."""

    def __post_init__(self) -> None:
        if not self.bits > 0.0:
            raise InputError(f"--bits {self.bits:g}: must be above 0")


@dataclass(frozen=True)
class SizeTarget:
    """A file of at most so many bytes."""

    megabytes: float
    """Of 10^6 bytes."""
    worth: tuple[float, ...] | None = None
    """What an error is worth in each texture, positive, in proportion; None: the same in all."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.megabytes) and self.megabytes > 0.0):
            raise InputError(f"--size {self.megabytes:g}: must be a number of megabytes above 0")


@dataclass(frozen=True)
class QualityTarget:
    """Each texture at least so near to its original, in as few words as possible."""

    psnr_db: float
    """Of mip 0."""

    def __post_init__(self) -> None:
        if not 0.0 < self.psnr_db <= HIGHEST_QUALITY_DB:
            raise InputError(
                f"--quality {self.psnr_db:g}: set it above 0 and up to {HIGHEST_QUALITY_DB} dB, the most that 8 bits give"
            )


Target = BitsTarget | SizeTarget | QualityTarget


def given_target(target: Target | None) -> dict[str, str]:
    """The option that asks for `target`, and its value; empty for none."""
    if target is None:
        return {}
    if isinstance(target, BitsTarget):
        return {"preset": target.preset} if target.preset is not None else {"bits": f"{target.bits:g}"}
    return {"size": f"{target.megabytes:g}"} if isinstance(target, SizeTarget) else {"quality": f"{target.psnr_db:g}"}


PRESETS: Mapping[PresetName, BitsTarget] = {
    "1bit": BitsTarget(1.0, preset="1bit"),
    "2bit": BitsTarget(2.0, preset="2bit"),
    "4bit": BitsTarget(4.0, preset="4bit"),
    "8bit": BitsTarget(8.0, preset="8bit"),
    "fast": BitsTarget(2.0, 4, 100, preset="fast"),
}
"""`fast`: about 2 bits a texel in blocks of 4x4 texels, decoded in at most 100 multiply-adds a texel."""
