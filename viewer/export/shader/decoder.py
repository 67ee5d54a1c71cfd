"""The decoder of a pack as items of source. Items that are equal in all planes are written once, the others for each plane."""

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
    """Return the checksum (CRC-32) of the decoding source, which tells codecs, sizes and packings apart."""
    return zlib.crc32("\n".join(decoding_source(pack, plane) for plane in planes_of(pack)).encode())


def prefixed(name: str) -> str:
    """Return the name of an item with the prefix of the library, so that it cannot collide with names of the including program."""
    if name.isupper():
        return f"{PREFIX.upper()}_{name}"
    return f"{PREFIX.title()}{name}" if name[0].isupper() else f"{PREFIX}_{name}"


def _of_plane(name: str, plane: Plane) -> str:
    if name.isupper():
        return f"{name}_OF_{plane.upper()}"
    return f"{name}{plane.title()}" if name[0].isupper() else f"{name}_{plane}"


def _differing(versions: list[dict[str, Item]]) -> set[str]:
    """Return the names of the items that differ between versions, or use an item that does. The entry always differs."""
    names = {name for version in versions for name in version}
    differing = {ENTRY}
    differing |= {name for name in names if len({version[name] for version in versions if name in version}) > 1}
    while True:
        more = {
            name
            for version in versions
            for name, item in version.items()
            if name not in differing and not differing.isdisjoint(names_used(item))
        }
        if not more:
            return differing
        differing |= more


def decoder_items(pack: Pack, rename: Callable[[str], str]) -> tuple[Item, ...]:
    """Return constants, structs and functions, each before its first use; function `decode_PLANE` decodes a plane.

    `rename` returns the written name of an item.
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
