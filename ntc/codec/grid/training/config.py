"""Options of training, the recipes, and the schedule of learning rates."""

import math
from dataclasses import dataclass, replace
from typing import Literal

from ntc.codec.encoding import EncodingChoices, EncodingOptions, RecipeName
from ntc.codec.grid.model import GridConfig
from ntc.codec.maps import BASE_ALONE, MapName


@dataclass(frozen=True)
class FreezingConfig:
    """Gradual freezing of the decoder: the scale of its updates falls from 1 to 0 (paper, Sec. 3)."""

    start: float = 0.5
    """Start of freezing as a share of the training: e_s of the paper."""
    duration: float = 0.1
    """Duration of freezing as a share of the training: T of the paper."""


@dataclass(frozen=True)
class TrainingConfig(EncodingOptions):
    """Options of the training of latents and decoders."""

    recipe: RecipeName = "best"
    steps: int | None = 3000
    """Optimisation steps; None when `epochs` sets the length."""
    epochs: float | None = None
    """Length in epochs. An epoch has as many samples as mip 0 has texels."""
    texels_per_texture: int = 512
    """Samples of each texture in a step; all groups train at once. Unused if `texels_per_group` is set."""
    texels_per_group: int | None = None
    """Samples of each group in a step; groups train one after the other, as in the paper."""
    latent_rate: float = 2e-2
    """Learning rate of latents."""
    decoder_rate: float = 1.6e-2
    """Learning rate of decoders and of adapters."""
    hidden_optimizer: Literal["adam", "muon"] = "muon"
    """Optimiser of the matrices of the hidden layers; everything else is trained by Adam."""
    hidden_rate: float = 3e-2
    """Learning rate of those matrices with muon. With adam, `decoder_rate` applies."""
    latent_start: Literal["chance", "image"] = "image"
    """Start of the latents: random numbers (`chance`), or a small copy of the texture (`image`)."""
    schedule: Literal["constant", "cosine", "trapezoid"] = "trapezoid"
    """Curve of the learning rates over the training (`rate_scale`)."""
    latent_clip: float | None = 2.5
    """Largest distance of 4-bit latents from their mean, in standard deviations of a texture's channel. Clipping keeps a few outliers
    from widening the quantisation steps. None: no clipping."""
    balance: float = 0.0
    """Exponent b of the weight (mean loss / texture's loss)^b of a texture's loss. With 0, all samples count equally; with 0.5,
    textures with small errors count nearly as much as others."""
    converged_db: float | None = 60.0
    """PSNR in dB of the samples at which a group stops training, once all its textures reach it: 8 bits show no further gain."""
    freezing: FreezingConfig | None = None
    """Freezing of decoders. None: none."""
    rounded_share: float = 0.05
    """Share of the steps, at the end, that trains decoders alone, on rounded latents. 0 if freezing has stopped decoders."""
    seed: int = 0
    device: Literal["auto", "cpu", "cuda"] = "auto"

    def __post_init__(self) -> None:
        if (self.steps is None) == (self.epochs is None):
            raise ValueError("training needs steps or epochs, and not both")


def recipe_config(name: RecipeName) -> TrainingConfig:
    """Return the options of a recipe. `paper`: rates, batch, length and freezing of the paper (Sec. 4). `best`: the best measured."""
    if name == "paper":
        return TrainingConfig(
            recipe="paper",
            steps=None,
            epochs=350.0,
            texels_per_group=32768,
            latent_rate=4e-3,
            decoder_rate=4e-4,
            latent_start="chance",
            hidden_optimizer="adam",
            schedule="constant",
            freezing=FreezingConfig(),
            rounded_share=0.0,
            latent_clip=None,
            converged_db=None,
        )
    return TrainingConfig()


def recipe_for_length(name: RecipeName, training: TrainingConfig) -> TrainingConfig:
    """Return a recipe with the length, samples, seed and device of `training`; all groups train at once."""
    return replace(
        recipe_config(name),
        steps=training.steps,
        epochs=training.epochs,
        texels_per_texture=training.texels_per_texture,
        texels_per_group=None,
        seed=training.seed,
        device=training.device,
    )


def chosen_config(choices: EncodingChoices) -> TrainingConfig:
    """Return the options of the recipe that `choices` names, overridden by its other choices."""
    training = replace(recipe_config(choices.recipe), seed=choices.seed, device=choices.device)
    if choices.steps is not None:
        return replace(training, steps=choices.steps, epochs=None)
    if choices.epochs is not None:
        return replace(training, steps=None, epochs=choices.epochs)
    return training


def recipe_codec(
    name: RecipeName, output_channels: int, levels: int | None, maps: tuple[MapName, ...] = BASE_ALONE
) -> GridConfig:
    """Return the codec settings of a recipe. `paper`: 4 channels of 8 bits, no adapters. `best`: 8 channels of 4 bits, adapters."""
    if name == "paper":
        return GridConfig(levels=levels, output_channels=output_channels, maps=maps)
    return GridConfig(
        latent_channels=8,
        latent_bits=4,
        levels=levels,
        output_channels=output_channels,
        maps=maps,
        weight_bits=16,
        adapters=True,
        adapter_output=True,
    )


def freezing_scale(progress: float, freezing: FreezingConfig | None) -> float:
    """Return the scale of the decoder's updates (paper, Sec. 3): 1 before e_s, then 0.5 (1 + cos(pi p)), 0 after e_s + T."""
    if freezing is None:
        return 1.0
    if freezing.duration <= 0.0:
        return 1.0 if progress < freezing.start else 0.0
    share = min(max((progress - freezing.start) / freezing.duration, 0.0), 1.0)
    return 0.5 * (1.0 + math.cos(math.pi * share))


FIRST_STEP = 1e-3
"""Added to the progress while the rate rises, so that the rate of the first step is not 0."""
WARM_UP = 1 / 30
"""Schedule `trapezoid`: share of the training in which the rates rise."""
FALL_FROM = 0.6
"""Schedule `trapezoid`: share of the training after which the rates fall."""


def rate_scale(progress: float, training: TrainingConfig) -> float:
    """Return the factor of all learning rates at `progress`, 0 to 1. `constant`: 1. `cosine`: half a cosine from 1 to 0.
    `trapezoid`: linear up to 1, then 1, then linear down to 0."""
    share = min(max(progress, 0.0), 1.0)
    if training.schedule == "constant":
        return 1.0
    if training.schedule == "cosine":
        return 0.5 * (1.0 + math.cos(math.pi * share))
    return max(0.0, min(1.0, (share + FIRST_STEP) / WARM_UP, (1.0 - share) / (1.0 - FALL_FROM)))
