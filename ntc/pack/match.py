"""Which textures of a scene a pack holds."""

from collections.abc import Sequence
from dataclasses import dataclass

from ntc.codec.model import Pack
from ntc.errors import InputError

NAMES_SHOWN = 5
"""Names listed in a message before the number of the others."""


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(names[:NAMES_SHOWN])
    return shown + (f" and {len(names) - NAMES_SHOWN} more" if len(names) > NAMES_SHOWN else "")


@dataclass(frozen=True)
class PackMatch:
    """How a pack and a scene fit together. Identity is the pixel hash, of sets that of all maps; names only help to explain."""

    texture_index: tuple[int, ...]
    """For each texture of the scene the index in the pack, -1 when the pack does not hold it."""
    absent: tuple[str, ...]
    """Names of the scene's textures that the pack does not hold."""
    changed: tuple[str, ...]
    """Those of `absent` whose name is in the pack, with other pixels."""

    @property
    def matched(self) -> int:
        """Textures of the scene that the pack decodes."""
        return len(self.texture_index) - len(self.absent)

    def decoders(self, pack: Pack) -> tuple[int, ...]:
        """For each texture of the scene its decoder in `pack`, which this match was made for; -1 where it has none."""
        return tuple(pack.textures[index].group if index >= 0 else -1 for index in self.texture_index)

    def line(self) -> str:
        """One line: how many textures match, and which do not."""
        line = f"{self.matched} of {len(self.texture_index)} textures match"
        unknown = [name for name in self.absent if name not in self.changed]
        if self.changed:
            line += f"; same name but other pixels: {_listed(self.changed)}"
        if unknown:
            line += f"; not in the pack: {_listed(unknown)}"
        return line


def match_pack(pack: Pack, identities: Sequence[Sequence[str]], names: Sequence[str]) -> PackMatch:
    """Find each scene texture in `pack`, by its name and what it may be found by: of a material set the hash of all its maps, then
    that of its base colour, by which a pack of base colours alone has it."""
    by_hash = {texture.pixel_hash: index for index, texture in enumerate(pack.textures)}
    pack_names = {texture.name for texture in pack.textures}
    index = tuple(next((by_hash[own] for own in hashes if own in by_hash), -1) for hashes in identities)
    absent = tuple(name for name, found in zip(names, index, strict=True) if found < 0)
    return PackMatch(index, absent, tuple(name for name in absent if name in pack_names))


def require_match(pack: Pack, match: PackMatch, scene: str) -> None:
    """Raise InputError when a pack decodes nothing of a scene that has textures."""
    if match.texture_index and match.matched == 0:
        raise InputError(
            f"{pack.path or pack.grouping.name}: made for another scene than {scene}: {match.line()}; "
            "encode this scene, or open the pack's own"
        )
