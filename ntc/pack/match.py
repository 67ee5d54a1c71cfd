"""Comparisons of packs: with the textures of a scene, and with another version of the same pack."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

from ntc.codec.model import EncodedTexture, Pack
from ntc.errors import InputError

NAMES_SHOWN = 5
"""Names that a message lists; the others are counted."""


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(names[:NAMES_SHOWN])
    return shown + (f" and {len(names) - NAMES_SHOWN} more" if len(names) > NAMES_SHOWN else "")


@dataclass(frozen=True)
class PackMatch:
    """The textures that a pack and a scene share.

    The pixel hash identifies a texture; that of a material set covers all its maps. Names only appear in messages.
    """

    texture_index: tuple[int, ...]
    """Index in the pack of each texture of the scene; -1 if the pack does not hold it."""
    absent: tuple[str, ...]
    """Names of the scene's textures that the pack does not hold."""
    changed: tuple[str, ...]
    """Names in `absent` that the pack holds with other pixels."""

    @property
    def matched(self) -> int:
        """Number of textures of the scene that the pack decodes."""
        return len(self.texture_index) - len(self.absent)

    def decoders(self, pack: Pack) -> tuple[int, ...]:
        """Return the decoder of each texture of the scene, -1 without one; `pack` is the pack of this match."""
        return tuple(pack.textures[index].group if index >= 0 else -1 for index in self.texture_index)

    def line(self) -> str:
        """Return one line of text: how many textures match, and which do not."""
        line = f"{self.matched} of {len(self.texture_index)} textures match"
        unknown = [name for name in self.absent if name not in self.changed]
        if self.changed:
            line += f"; same name but other pixels: {_listed(self.changed)}"
        if unknown:
            line += f"; not in the pack: {_listed(unknown)}"
        return line


def match_pack(pack: Pack, identities: Sequence[Sequence[str]], names: Sequence[str]) -> PackMatch:
    """Find each texture of a scene in `pack`.

    `identities` are the pixel hashes of each texture, tried in order: a material set has that of all its maps, then that of its base
    colour, because a pack may hold base colours alone. `names` are for messages.
    """
    by_hash = {texture.pixel_hash: index for index, texture in enumerate(pack.textures)}
    pack_names = {texture.name for texture in pack.textures}
    index = tuple(next((by_hash[key] for key in hashes if key in by_hash), -1) for hashes in identities)
    absent = tuple(name for name, number in zip(names, index, strict=True) if number < 0)
    return PackMatch(index, absent, tuple(name for name in absent if name in pack_names))


def require_match(pack: Pack, match: PackMatch, scene: str) -> None:
    """Raise InputError if a scene has textures and the pack decodes none of them."""
    if match.texture_index and match.matched == 0:
        raise InputError(
            f"{pack.path or pack.grouping.name}: made for another scene than {scene}: {match.line()}; "
            "encode this scene, or open the pack's own"
        )


_KNOWN_FIELDS = {field.name for field in fields(EncodedTexture)}


def _same(first: Any, second: Any) -> bool:
    """Return whether two arrays, or dataclasses or tuples of arrays, hold equal values. None equals only None."""
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
    # The fields that the codec adds are those that a texture is decoded from.
    parts = [field.name for field in fields(first) if field.name not in _KNOWN_FIELDS]
    return space and all(_same(getattr(first, part), getattr(second, part)) for part in parts)


def same_shape(old: Pack, new: Pack) -> bool:
    """Return whether two packs have the same codec settings, and textures of the same sizes and maps in the same order."""
    sizes = [[(t.pixel_hash, t.width, t.height, t.maps, t.code_mips) for t in pack.textures] for pack in (old, new)]
    return old.config == new.config and sizes[0] == sizes[1]


def changed_textures(old: Pack, new: Pack) -> frozenset[int]:
    """Return the indices of the textures that two packs of the same shape decode differently."""
    same: dict[tuple[int, int], bool] = {}

    def decodes_alike(first: EncodedTexture, second: EncodedTexture) -> bool:
        groups = (first.group, second.group)
        if groups not in same:
            same[groups] = _same(old.decoders[groups[0]], new.decoders[groups[1]])
        return same[groups] and _same_texture(first, second)

    pairs = zip(old.textures, new.textures, strict=True)
    return frozenset(index for index, pair in enumerate(pairs) if not decodes_alike(*pair))


def changed_groups(old: Pack, new: Pack) -> frozenset[int]:
    """Return the groups of `new` with a texture that `old`, a pack of the same shape, decodes differently.

    Arrays that both packs share are not compared. So two versions of one training are compared only where snapshots replaced
    something.
    """
    return frozenset(new.textures[index].group for index in changed_textures(old, new))
