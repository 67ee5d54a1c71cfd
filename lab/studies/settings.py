"""Shared settings of the trainings of a study."""

from dataclasses import dataclass, replace
from typing import Literal

from ntc.codec.encoding import RecipeName
from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.training.config import TrainingConfig, recipe_codec, recipe_config, recipe_for_length
from ntc.errors import InputError

BlockSide = Literal[4, 8]
"""Side of a block of codec `block` in texels."""
ScaleName = Literal["small", "paper"]
DiskFormat = Literal["jpeg", "xuastc", "etc1s"]
DISK_FORMATS: tuple[DiskFormat, ...] = ("jpeg", "xuastc", "etc1s")
QUALITIES: dict[DiskFormat, tuple[int, ...]] = {
    "jpeg": (20, 40, 60, 75, 85, 92, 96, 99),
    "xuastc": (10, 90, 100),
    "etc1s": (10, 50, 100),
}
"""Quality settings by format, on each encoder's scale from 1 to 100. alktx2 has XUASTC only in blocks of 6x6 texels."""


@dataclass(frozen=True)
class StudySettings:
    """Settings of every training of a study."""

    scale: ScaleName = "small"
    """Length of trainings. small: equal steps and samples for all, minutes on two cores. paper: 350 epochs, for a GPU."""
    steps: int = 1000
    """Steps of each training at scale small."""
    texels_per_texture: int = 512
    """Samples of each texture per step at scale small."""
    seeds: tuple[int, ...] = (0,)
    levels: int | None = 1
    """Latent levels; 1 is only mip 0, as in the paper."""
    device: Literal["auto", "cpu", "cuda"] = "auto"

    def __post_init__(self) -> None:
        for name, value in (("steps", self.steps), ("texels-per-texture", self.texels_per_texture)):
            if value < 1:
                raise InputError(f"--{name} {value}: must be at least 1")
        if not self.seeds:
            raise InputError("--seeds: name at least one")
        if self.levels is not None and not 1 <= self.levels <= 16:
            raise InputError(f"--levels {self.levels}: must be 1 to 16")

    def training(self, recipe: RecipeName, seed: int) -> TrainingConfig:
        """Return the training of `recipe` at this scale."""
        if self.scale == "paper":
            length = (
                recipe_config(recipe)
                if recipe == "paper"
                else TrainingConfig(steps=None, epochs=350.0, texels_per_texture=8192)
            )
            return replace(length, seed=seed, device=self.device)
        same = TrainingConfig(
            steps=self.steps, texels_per_texture=self.texels_per_texture, seed=seed, device=self.device
        )
        return recipe_for_length(recipe, same)

    def codec(self, recipe: RecipeName, output_channels: int) -> GridConfig:
        """Return the codec of `recipe`."""
        return recipe_codec(recipe, output_channels, self.levels)
