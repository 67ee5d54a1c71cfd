"""The decoder of a pack as items of source: what all its planes share once, and the functions of each plane by its name."""

import zlib
from collections.abc import Callable
from typing import Final

from ntc.codec.maps import Plane, plane_channels
from ntc.codec.model import Pack
from viewer.export.shader.parse import PRODUCT_HIGH, parse
from viewer.export.shader.source import ENTRY, STORED, WORD_AT, decoding_source
from viewer.export.shader.syntax import Item, names_used, renamed

PREFIX: Final = "ntc"


def planes_of(pack: Pack) -> tuple[Plane, ...]:
    """Return the planes that the codec of `pack` has."""
    return tuple(plane_channels(pack.config.maps, pack.config.output_channels))


def codec_number(pack: Pack) -> int:
    """Return a number that decoders for other codecs, sizes and packings do not have: their sum (CRC-32)."""
    return zlib.crc32("\n".join(decoding_source(pack, plane) for plane in planes_of(pack)).encode())


def prefixed(name: str) -> str:
    """Return a name of something outside functions, told apart from those of the program that it goes into."""
    if name.isupper():
        return f"{PREFIX.upper()}_{name}"
    return f"{PREFIX.title()}{name}" if name[0].isupper() else f"{PREFIX}_{name}"


def _of_plane(name: str, plane: Plane) -> str:
    if name.isupper():
        return f"{name}_OF_{plane.upper()}"
    return f"{name}{plane.title()}" if name[0].isupper() else f"{name}_{plane}"


def _differing(versions: list[dict[str, Item]]) -> set[str]:
    """Return the names of what is not the same in all versions, or takes what is not; the entry is each version's own."""
    names = {name for version in versions for name in version}
    found = {ENTRY}
    found |= {name for name in names if len({version[name] for version in versions if name in version}) > 1}
    while True:
        more = {
            name
            for version in versions
            for name, item in version.items()
            if name not in found and not found.isdisjoint(names_used(item))
        }
        if not more:
            return found
        found |= more


def decoder_items(pack: Pack, rename: Callable[[str], str]) -> tuple[Item, ...]:
    """Constants, structs and functions in an order in which each is known before it is used; `decode_PLANE` decodes a plane.

    `rename` gives the name by which something outside functions is called.
    """
    planes = planes_of(pack)
    parsed = [parse(decoding_source(pack, plane), STORED, ENTRY) for plane in planes]
    versions = [{item.name: item for item in items} for items in parsed]
    differing = _differing(versions)
    written: list[Item] = []
    seen: set[str] = set()
    for plane, items in zip(planes, parsed, strict=True):
        names = {
            item.name: rename(_of_plane(item.name, plane) if item.name in differing else item.name) for item in items
        }
        names |= {name: rename(name) for name in (WORD_AT, PRODUCT_HIGH)}
        for item in items:
            if names[item.name] not in seen:
                seen.add(names[item.name])
                written.append(renamed(item, names))
    return tuple(written)
