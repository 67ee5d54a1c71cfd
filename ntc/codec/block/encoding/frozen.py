"""Putting new textures into groups that exist: their decoders stay as they are, each texture takes the one that suits it best."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.blocks import sample_textures
from ntc.codec.block.encoding.sharing import RateCurve, sizes_within
from ntc.codec.block.encoding.stages import FittedGroup, encode_blocks, encode_fitted
from ntc.codec.block.encoding.tables import rate_curve
from ntc.codec.block.model import BlockDecoder
from ntc.codec.checks import check_textures
from ntc.codec.model import Grouping, Pack
from ntc.codec.psnr import mse_of_psnr, psnr_of_mse
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError

SAMPLED_BLOCKS = 512
"""Of a texture: by them it chooses among decoders."""


@dataclass(frozen=True)
class Drift:
    """How much worse textures are in old groups than in a fresh one, at equal bits."""

    textures: int
    """That were compared."""
    frozen_db: float
    """PSNR in dB of their mean square error with the old decoders."""
    fresh_db: float
    """The same with a decoder fitted to them."""

    @property
    def loss_db(self) -> float:
        """What a fresh group would gain."""
        return self.fresh_db - self.frozen_db


def _expected_error(curve: RateCurve, config: BlockConfig) -> float:
    """Mean square error where the texture has as many words as textures have on average."""
    sizes = sizes_within(curve.errors, config.block_words, config.mean_words)
    return float(np.take_along_axis(curve.errors, sizes[:, None], axis=1).mean())


def encode_with_decoders(
    textures: Sequence[SourceTexture],
    decoders: Sequence[BlockDecoder],
    config: BlockConfig,
    grouping: str,
    seed: int = 0,
    threads: int | None = None,
) -> Pack:
    """A pack of `textures`, each with that of `decoders` that codes a sample of its blocks best; decoders that none takes are left
    out. `grouping` is the name of its grouping.

    Raises InputError for textures that the codec has no room for.
    """
    if not decoders:
        raise InputError("there is no decoder to encode with; encode a first set of textures")
    check_textures(textures, Grouping(grouping, (0,) * len(textures)), config)
    chosen: list[int] = []
    curves: list[RateCurve] = []
    for texture in textures:
        (sample,) = sample_textures([texture], config, seed, SAMPLED_BLOCKS)
        own = [rate_curve(sample, decoder, config) for decoder in decoders]
        best = int(np.argmin([_expected_error(curve, config) for curve in own]))
        chosen.append(best)
        curves.append(own[best])
    found = Grouping.of_labels(grouping, chosen, {"frozen": True})
    fitted = [
        FittedGroup(
            group,
            tuple(index for index, own in enumerate(found.groups) if own == group),
            decoders[chosen[found.groups.index(group)]],
            tuple(curve for curve, own in zip(curves, found.groups, strict=True) if own == group),
        )
        for group in range(found.group_count)
    ]
    return encode_fitted(textures, fitted, found, config, seed, threads)


def measured_drift(
    textures: Sequence[SourceTexture],
    decoders: Sequence[BlockDecoder],
    config: BlockConfig,
    sample: int,
    seed: int = 0,
    threads: int | None = None,
) -> Drift:
    """Encode `sample` of `textures` with `decoders`, and the same in a fresh group of their own, in equal bits."""
    random = np.random.default_rng(seed)
    own = [textures[place] for place in np.sort(random.permutation(len(textures))[:sample])]
    frozen = encode_with_decoders(own, decoders, config, "frozen", seed, threads)
    fresh = encode_blocks(own, Grouping("single", (0,) * len(own)), config, seed, threads=threads)
    errors = [np.mean([mse_of_psnr(each.psnr_db or 0.0) for each in pack.textures]) for pack in (frozen, fresh)]
    return Drift(len(own), psnr_of_mse(float(errors[0])), psnr_of_mse(float(errors[1])))
