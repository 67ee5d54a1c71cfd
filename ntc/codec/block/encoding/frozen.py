"""Putting new textures into groups that exist: their decoders stay as they are, each texture takes the one that suits it best."""

from collections.abc import Sequence

import numpy as np

from ntc.codec.block.config import BlockConfig, BlockOptions
from ntc.codec.block.encoding.blocks import sample_textures
from ntc.codec.block.encoding.groups import FittedGroup
from ntc.codec.block.encoding.sharing import RateCurve, sizes_within
from ntc.codec.block.encoding.stages import BlockEncoder
from ntc.codec.block.encoding.tables import rate_curve
from ntc.codec.block.model import BlockDecoder, BlockParts
from ntc.codec.checks import check_textures
from ntc.codec.codec import Assigned
from ntc.codec.encoding import EncodingTask
from ntc.codec.model import Grouping, Pack
from ntc.codec.quality import mse_of_psnr, psnr_of_mse
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError

COMPARED = 16
"""Textures that are also encoded in a fresh group, to tell the drift."""
SAMPLED_BLOCKS = 512
"""Of a texture: by them it chooses among decoders."""


def _expected_error(curve: RateCurve, config: BlockConfig) -> float:
    """Mean square error where the texture has as many words as textures have on average."""
    sizes = sizes_within(curve.errors, config.block_words, config.mean_words)
    return float(np.take_along_axis(curve.errors, sizes[:, None], axis=1).mean())


def _encoded(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    config: BlockConfig,
    options: BlockOptions,
    fitted: Sequence[FittedGroup] | None = None,
) -> Pack:
    groups = tuple(range(grouping.group_count))
    encoder = BlockEncoder(EncodingTask(tuple(textures), grouping, config, options, groups), fitted)
    for _ in encoder.pieces():
        pass
    found = list(encoder.encoded(groups))
    encoded = {index: each for own in found for index, each in zip(own.members, own.textures, strict=True)}
    in_order = tuple(encoded[index] for index in range(len(textures)))
    return Pack(encoder.settings, grouping, in_order, tuple(own.decoder for own in found), encoder.record())


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
    return _encoded(textures, found, config, BlockOptions(seed, threads=threads), fitted)


def assigned(
    textures: Sequence[SourceTexture], packs: Sequence[BlockParts], grouping: str, most: int, seed: int = 0
) -> Assigned:
    """`textures` encoded with at most so many decoders of `packs`, evenly spread ones.

    Some of them are also encoded in a fresh group of their own, in equal bits.
    """
    config, known = packs[0].config, [decoder for pack in packs for decoder in pack.decoders]
    places = np.unique(np.linspace(0, len(known) - 1, min(len(known), most)).astype(int))
    decoders = [known[place] for place in places]
    pack = encode_with_decoders(textures, decoders, config, grouping, seed)
    random = np.random.default_rng(seed)
    own = [textures[place] for place in np.sort(random.permutation(len(textures))[:COMPARED])]
    frozen = encode_with_decoders(own, decoders, config, "frozen", seed)
    fresh = _encoded(own, Grouping("single", (0,) * len(own)), config, BlockOptions(seed))
    errors = [
        float(np.mean([mse_of_psnr(each.psnr_db or 0.0) for each in found.textures])) for found in (frozen, fresh)
    ]
    return Assigned(pack, len(decoders), len(own), psnr_of_mse(errors[0]), psnr_of_mse(errors[1]))
