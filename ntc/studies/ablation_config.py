"""Settings of the ablation study."""

from dataclasses import dataclass

from ntc.errors import InputError


@dataclass(frozen=True)
class AblationConfig:
    """What is trained."""

    steps: int = 1500
    texels_per_texture: int = 512
    levels: int | None = 1
    """Latent levels; 1: mip 0 alone, as in the paper."""
    seeds: tuple[int, ...] = (0,)
    device: str = "auto"

    def __post_init__(self) -> None:
        for name, value in (("steps", self.steps), ("texels-per-texture", self.texels_per_texture)):
            if value < 1:
                raise InputError(f"--{name} {value}: must be at least 1")
        if not self.seeds:
            raise InputError("--seeds: name at least one")
