"""Packed textures of a glTF file: the pack's textures and channels that replace its texture entries (NV_texture_swizzle)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Any

from ntc.codec.maps import PLANE_OF_MAP, TABLE_OF_MAP, MapName, map_slices
from ntc.codec.model import EncodedTexture, Pack
from ntc.pack.match import PackMatch
from viewer.export.gltf.document import GltfDocument
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.materials import MaterialSource, read_materials
from viewer.scene.gltf.packed_textures import NO_CHANNEL, PACK_MIME_TYPE, PIXEL_HASH, SWIZZLE
from viewer.scene.gltf.textures import TextureReference
from viewer.scene.model import Scene
from viewer.scene.report import ReportNotes


@dataclass(eq=False)
class PackedTextureOption:
    """Packed texture that replaces a texture entry of the file, in some materials."""

    image: int
    """Index of the file's image that is replaced, as the viewer chooses it."""
    layer: int
    """Index of the texture in the pack."""
    channels: list[int] = field(default_factory=lambda: [NO_CHANNEL] * 4)
    """Channel of the pack's texture for each component of the glTF texture."""
    references: list[tuple[int, MapName]] = field(default_factory=list)
    """(material, map) pairs that read the texture."""


def _channels(texture: EncodedTexture, name: MapName) -> dict[int, int]:
    """Return the channel of `texture` for each component of the glTF texture that holds map `name`."""
    place = map_slices(texture.maps, texture.channels)[name]
    channels = range(place.start, place.stop)
    if name != "base":
        return dict(zip(TABLE_OF_MAP[name].gltf_channels, channels, strict=True))
    # One or two channels are grey, with alpha last.
    colors = list(channels[:3]) if len(channels) >= 3 else [channels[0]] * 3
    alpha = [texture.channels - 1] if "alpha" in texture.maps else [channels[-1]] if len(channels) in (2, 4) else []
    return dict(enumerate([*colors, *alpha]))


def _packed_maps(
    scene: Scene, sources: tuple[MaterialSource, ...]
) -> Iterator[tuple[int, MapName, TextureReference, int]]:
    """Yield (material, map, reference in the file, texture of the scene) of each map that a texture of the scene contains."""
    for number, (material, source) in enumerate(zip(scene.materials, sources, strict=False)):
        for name, reference in source.maps.items():
            plane = material.plane(PLANE_OF_MAP[name])
            if plane is not None and name in plane.maps:
                yield number, name, reference, plane.texture_id


def packed_options(
    file: GltfFile, scene: Scene, pack: Pack, layers: tuple[int, ...]
) -> dict[int, list[PackedTextureOption]]:
    """Return the packed textures by texture entry of `file`. `layers`: texture of `pack` by texture of `scene`, -1 for none."""
    options_of_entries: dict[int, list[PackedTextureOption]] = {}
    for material, name, reference, texture_id in _packed_maps(scene, read_materials(file, ReportNotes())):
        layer = layers[texture_id]
        if layer < 0 or name not in pack.textures[layer].maps:
            continue
        options = options_of_entries.setdefault(reference.texture, [])
        option = next((each for each in options if each.layer == layer), None)
        if option is None:
            option = PackedTextureOption(reference.image, layer)
            options.append(option)
        for component, channel in _channels(pack.textures[layer], name).items():
            option.channels[component] = channel
        option.references.append((material, name))
    return options_of_entries


def held_whole(file: GltfFile, scene: Scene, options: Mapping[int, list[PackedTextureOption]]) -> set[int]:
    """Return the texture entries of which the pack has every map that materials read: none has alpha or a map that became a factor."""
    held = {
        reference for entry_options in options.values() for option in entry_options for reference in option.references
    }
    whole = set(options)
    sources = read_materials(file, ReportNotes())
    for number, (material, source) in enumerate(zip(scene.materials, sources, strict=False)):
        for name, reference in source.maps.items():
            texture_id = material.plane_texture(PLANE_OF_MAP[name])
            coverage = name == "base" and texture_id >= 0 and scene.textures[texture_id].has_alpha
            if (number, name) not in held or coverage:
                whole.discard(reference.texture)
    return whole


@dataclass(frozen=True, eq=False)
class PackOptions:
    """Pack of the scene, and the texture entries of the file that its textures replace."""

    pack: Pack
    match: PackMatch
    options: Mapping[int, list[PackedTextureOption]]
    """Packed textures by texture entry of the file."""


def add_options(document: GltfDocument, packs: Sequence[PackOptions], uris: Sequence[str]) -> None:
    """Add `packs`, which lie at `uris`, as options to the texture entries of the document, in this order.

    A texture entry that different materials read from different textures of a pack becomes several entries.
    """
    images, textures = document.entries("images"), document.entries("textures")
    first = len(images)
    for packed, uri in zip(packs, uris, strict=True):
        images.append({"uri": uri, "mimeType": PACK_MIME_TYPE, "name": packed.pack.grouping.name})
    for number, options in separate_entries(document, [packed.options for packed in packs]):
        texture = textures[number]
        stated = [
            {
                "source": first + place,
                "arrayLayer": option.layer,
                "channels": option.channels,
                "extras": {PIXEL_HASH: packed.pack.textures[option.layer].pixel_hash},
            }
            for place, (packed, option) in enumerate(zip(packs, options, strict=True))
            if option is not None
        ]
        before = texture.get("extensions", {}).get(SWIZZLE, {}).get("options", [])
        texture["extensions"] = {**texture.get("extensions", {}), SWIZZLE: {"options": [*stated, *before]}}
    document.use_extension(SWIZZLE)


_Options = tuple[PackedTextureOption | None, ...]


def separate_entries(
    document: GltfDocument, packs: Sequence[Mapping[int, list[PackedTextureOption]]]
) -> list[tuple[int, _Options]]:
    """Return (texture entry, its option in each pack). An entry with several options of one pack becomes several entries."""
    textures = document.entries("textures")
    entries: list[tuple[int, _Options]] = []
    for number in dict.fromkeys(chain.from_iterable(packs)):
        plain = dict(textures[number])
        for place, (options, references) in enumerate(_uses(packs, number).items()):
            target = number
            if place > 0:
                target = len(textures)
                textures.append(dict(plain))
                for material, name in references:
                    _texture_info(document.entries("materials")[material], name)["index"] = target
            entries.append((target, options))
    return entries


def _uses(
    packs: Sequence[Mapping[int, list[PackedTextureOption]]], number: int
) -> dict[_Options, list[tuple[int, MapName]]]:
    """Return the (material, map) pairs that read texture entry `number`, by their option in each pack."""

    def place(reference: tuple[int, MapName]) -> tuple[int, tuple[str, ...]]:
        # Maps at one place of a material read one entry.
        return reference[0], TABLE_OF_MAP[reference[1]].gltf

    uses: dict[_Options, list[tuple[int, MapName]]] = {}
    options = [pack.get(number, []) for pack in packs]
    for reference in dict.fromkeys(chain.from_iterable(one.references for one in chain.from_iterable(options))):
        here = place(reference)
        key = tuple(next((one for one in each if here in map(place, one.references)), None) for each in options)
        uses.setdefault(key, []).append(reference)
    return uses


def remove_packs(document: GltfDocument) -> None:
    """Remove the packs of an earlier export from the document."""
    packs = {n for n, image in enumerate(document.entries("images")) if image.get("mimeType") == PACK_MIME_TYPE}
    for texture in document.entries("textures"):
        extension = texture.get("extensions", {}).get(SWIZZLE)
        if extension is not None:
            remaining = [option for option in extension.get("options", []) if option["source"] not in packs]
            texture["extensions"].pop(SWIZZLE)
            if remaining:
                texture["extensions"][SWIZZLE] = {"options": remaining}
    document.remove_images(packs)


def _texture_info(material: dict[str, Any], name: MapName) -> dict[str, Any]:
    """Return the JSON object in which `material` names the texture of a map."""
    info: dict[str, Any] = {}
    for place in TABLE_OF_MAP[name].gltf:
        owner: Any = material
        for key in place.split("."):
            owner = owner.get(key) if isinstance(owner, dict) else None
        if isinstance(owner, dict):
            info = owner
    return info
