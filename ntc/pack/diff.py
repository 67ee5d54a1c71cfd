"""What differs between two versions of a pack."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ntc.pack.model import Adapter, Decoder, EncodedTexture, Pack


def _equal(first: NDArray[np.generic] | None, second: NDArray[np.generic] | None) -> bool:
    if first is second:
        return True
    return first is not None and second is not None and np.array_equal(first, second)


def _same_decoder(first: Decoder, second: Decoder) -> bool:
    pairs = (*zip(first.weights, second.weights, strict=True), *zip(first.biases, second.biases, strict=True))
    return first is second or all(_equal(a, b) for a, b in pairs)


def _same_adapter(first: Adapter | None, second: Adapter | None) -> bool:
    if first is None or second is None or first is second:
        return first is second
    return (
        _equal(first.scales, second.scales)
        and _equal(first.biases, second.biases)
        and _equal(first.output_weight, second.output_weight)
        and _equal(first.output_bias, second.output_bias)
    )


def _same_texture(first: EncodedTexture, second: EncodedTexture) -> bool:
    if first is second:
        return True
    shown = (first.channels, first.color_space) == (second.channels, second.color_space)
    arrays = ((first.latents, second.latents), (first.scale, second.scale), (first.offset, second.offset))
    return shown and all(_equal(a, b) for a, b in arrays) and _same_adapter(first.adapter, second.adapter)


def same_shape(old: Pack, new: Pack) -> bool:
    """Whether both hold textures of the same sizes in the same order, in one codec."""
    sizes = [[(t.pixel_hash, t.width, t.height) for t in pack.textures] for pack in (old, new)]
    return old.config == new.config and sizes[0] == sizes[1]


def changed_textures(old: Pack, new: Pack) -> frozenset[int]:
    """Indices of the textures that the two packs, which have the same shape, decode differently."""
    same: dict[tuple[int, int], bool] = {}

    def decodes_alike(first: EncodedTexture, second: EncodedTexture) -> bool:
        groups = (first.group, second.group)
        if groups not in same:
            same[groups] = _same_decoder(old.decoders[groups[0]], new.decoders[groups[1]])
        return same[groups] and _same_texture(first, second)

    pairs: Iterable[tuple[EncodedTexture, EncodedTexture]] = zip(old.textures, new.textures, strict=True)
    return frozenset(index for index, pair in enumerate(pairs) if not decodes_alike(*pair))
