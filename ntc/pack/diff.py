"""What differs between two versions of a pack."""

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from ntc.codec.model import EncodedTexture, Pack

_KNOWN_FIELDS = {field.name for field in fields(EncodedTexture)}


def _same(first: Any, second: Any) -> bool:
    """Whether two arrays, or dataclasses or tuples of them, hold the same values; None is the same as None alone."""
    if first is second:
        return True
    if isinstance(first, tuple):
        return all(map(_same, first, second))
    if is_dataclass(first) and second is not None:
        return all(_same(getattr(first, field.name), getattr(second, field.name)) for field in fields(first))
    return first is not None and second is not None and np.array_equal(first, second)


def _same_texture(first: EncodedTexture, second: EncodedTexture) -> bool:
    if first is second:
        return True
    space = (first.maps, first.channels, first.color_space) == (second.maps, second.channels, second.color_space)
    # What its codec adds is what it is decoded from.
    parts = [field.name for field in fields(first) if field.name not in _KNOWN_FIELDS]
    return space and all(_same(getattr(first, part), getattr(second, part)) for part in parts)


def same_shape(old: Pack, new: Pack) -> bool:
    """Whether both hold textures of the same sizes and maps in the same order, in one codec."""
    sizes = [[(t.pixel_hash, t.width, t.height, t.maps) for t in pack.textures] for pack in (old, new)]
    return old.config == new.config and sizes[0] == sizes[1]


def changed_textures(old: Pack, new: Pack) -> frozenset[int]:
    """Indices of the textures that the two packs, which have the same shape, decode differently."""
    same: dict[tuple[int, int], bool] = {}

    def decodes_alike(first: EncodedTexture, second: EncodedTexture) -> bool:
        groups = (first.group, second.group)
        if groups not in same:
            same[groups] = _same(old.decoders[groups[0]], new.decoders[groups[1]])
        return same[groups] and _same_texture(first, second)

    pairs = zip(old.textures, new.textures, strict=True)
    return frozenset(index for index, pair in enumerate(pairs) if not decodes_alike(*pair))


def changed_groups(old: Pack, new: Pack) -> frozenset[int]:
    """Groups of `new` with a texture that `old`, a pack of the same shape, decodes differently.

    Arrays that both packs share are not compared: versions of one training differ in what a snapshot has replaced alone.
    """
    return frozenset(new.textures[index].group for index in changed_textures(old, new))
