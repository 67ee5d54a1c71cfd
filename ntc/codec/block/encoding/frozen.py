"""Putting new textures into groups that exist: their decoders stay as they are, each texture takes the one that suits it best."""

from collections.abc import Sequence

import numpy as np

from ntc.codec.block.config import BlockConfig, BlockOptions
from ntc.codec.block.encoding.bit_allocation import RateCurve, sizes_within
from ntc.codec.block.encoding.blocks import sample_textures
from ntc.codec.block.encoding.groups import FittedGroup
from ntc.codec.block.encoding.stages import BlockEncoder
from ntc.codec.block.encoding.tables import rate_curve
from ntc.codec.block.model import BlockDecoder
from ntc.codec.checks import check_textures
from ntc.codec.config import UNIVERSAL
from ntc.codec.encoding import EncodingTask
from ntc.codec.model import Grouping, Pack
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError

MOST_DECODERS = 64
"""Most decoders that a texture is tried with: of more, so many evenly spread ones."""
SAMPLED_BLOCKS = 512
"""Number of blocks of a texture by which it chooses among decoders."""


def _expected_error(curve: RateCurve, config: BlockConfig) -> float:
    """Mean square error where the texture has as many words as textures have on average."""
    sizes = sizes_within(curve.errors, config.block_words, config.mean_words)
    return float(np.take_along_axis(curve.errors, sizes[:, None], axis=1).mean())


def encode_with_decoders(
    textures: Sequence[SourceTexture],
    decoders: Sequence[BlockDecoder],
    config: BlockConfig,
    grouping: str,
    options: BlockOptions,
) -> Pack:
    """Encode `textures` into a pack, each with that of `decoders` that codes a sample of its blocks best; decoders that none takes are
    left out. `grouping` is the name of its grouping.

    Raises InputError for decoders that ship with the program, and for textures that the codec has no room for.
    """
    if grouping == UNIVERSAL or not decoders:
        raise InputError("the pack has no decoders of its own to encode with; use --grouping universal")
    places = np.unique(np.linspace(0, len(decoders) - 1, min(len(decoders), MOST_DECODERS)).astype(int))
    decoders = [decoders[place] for place in places]
    check_textures(textures, Grouping(grouping, (0,) * len(textures)), config)
    chosen: list[int] = []
    curves: list[RateCurve] = []
    for texture in textures:
        (sample,) = sample_textures([texture], config, options.seed, SAMPLED_BLOCKS)
        candidates = [rate_curve(sample, decoder, config) for decoder in decoders]
        best = int(np.argmin([_expected_error(curve, config) for curve in candidates]))
        chosen.append(best)
        curves.append(candidates[best])
    placed = Grouping.of_labels(grouping, chosen, {"frozen": True})
    fitted = [
        FittedGroup(
            group,
            tuple(index for index, other in enumerate(placed.groups) if other == group),
            decoders[chosen[placed.groups.index(group)]],
            tuple(curve for curve, other in zip(curves, placed.groups, strict=True) if other == group),
        )
        for group in range(placed.group_count)
    ]
    groups = tuple(range(placed.group_count))
    encoder = BlockEncoder(EncodingTask(tuple(textures), placed, config, options, groups), fitted)
    for _ in encoder.pieces():
        pass
    done = list(encoder.encoded(groups))
    encoded = {index: each for group in done for index, each in zip(group.members, group.textures, strict=True)}
    in_order = tuple(encoded[index] for index in range(len(textures)))
    return Pack(encoder.settings, placed, in_order, tuple(group.decoder for group in done), encoder.record())
