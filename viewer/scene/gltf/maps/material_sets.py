"""Finished materials: their maps gathered into textures, constant ones multiplied into factors.

Planes of a material that share size, UVs and sampler lie in one texture, a material set, unless an earlier material has them in
another already: every image is in one texture only, however many materials read it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import BASE_ALONE, MAP_CHANNELS, MAPS, PLANE_COMPONENTS, PLANE_OF_MAP, MapName, Plane
from ntc.codec.mips import srgb_to_linear
from ntc.codec.textures import hash_channels
from ntc.errors import InputError
from viewer.locations import cache_folder
from viewer.scene.gltf.buffers import Buffers
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.maps.images import (
    ImageReader,
    SceneImage,
    TooManyPixelsError,
    find_images,
    image_uses,
    note_absent,
    resampled,
)
from viewer.scene.gltf.materials import MaterialSource
from viewer.scene.gltf.textures import IDENTITY, Affine, TextureReference
from viewer.scene.images import ProgressReport, map_in_threads
from viewer.scene.model import Material, PlaneTexture, Sampler, SceneTexture, SurfaceFactors
from viewer.scene.pixels import FactsFile, MapFacts, PixelCache
from viewer.scene.report import ReportNotes


@dataclass(frozen=True)
class ImageMap:
    """Map of an image, at the size of the texture that it lies in. Equal ones are the same."""

    image: SceneImage
    name: MapName
    key: str
    """Identity of its pixels at their own size."""
    size: tuple[int, int]
    """(width, height) in texels of the texture."""
    cache: PixelCache

    def pixels(self) -> NDArray[np.uint8]:
        """Return [H, W, channels of the map]. Raises InputError."""
        found = self.image.read().maps.get(self.name)
        if found is None:
            raise InputError(f"{self.image.origin}: has changed since the scene was opened; open it again")
        if self.image.facts.size == self.size:
            return found
        own = found
        return self.cache.get(self, lambda: resampled(own, *self.size))


@dataclass(frozen=True, eq=False)
class ImagesOfTexture:
    """The pixels of one texture (`viewer.scene.pixels.TexturePixels`)."""

    base: SceneImage | None
    maps: Mapping[MapName, ImageMap]
    cache: PixelCache

    def picture(self) -> NDArray[np.uint8]:
        """Return [H, W, 3] uint8 sRGB."""
        if self.base is None:
            first = next(iter(self.maps))
            return self.cache.get(self, lambda: _picture(first, self.maps[first].pixels()))
        pixels = self.base.read().pixels
        if pixels is None:
            raise InputError(f"{self.base.origin}: has changed since the scene was opened; open it again")
        return pixels

    def alpha(self) -> NDArray[np.uint8] | None:
        """Return [H, W] uint8."""
        return None if self.base is None else self.base.read().alpha

    def further(self) -> Mapping[MapName, NDArray[np.uint8]]:
        """Return the maps besides the base colour, each [H, W, C] uint8."""
        return _MapsWhenNeeded(self.maps)

    def set_hash(self) -> str:
        """Return the hash of all maps together."""
        further = list(self.further().values())
        if self.base is None:
            return hash_channels(further)
        color, alpha = self.picture(), self.alpha()
        return hash_channels([color if alpha is None else np.dstack([color, alpha]), *further])


class _MapsWhenNeeded(Mapping[MapName, NDArray[np.uint8]]):
    """Reads the image of a map when that map is asked for."""

    def __init__(self, maps: Mapping[MapName, ImageMap]) -> None:
        self._maps = maps

    def __getitem__(self, name: MapName) -> NDArray[np.uint8]:
        return self._maps[name].pixels()

    def __iter__(self) -> Iterator[MapName]:
        return iter(self._maps)

    def __len__(self) -> int:
        return len(self._maps)


def _picture(name: MapName, pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return [H, W, 3] uint8 that shows a map [H, W, C]: normals with the z of a unit vector, single channels as grey."""
    if pixels.shape[2] == 1:
        return np.repeat(pixels, 3, axis=2)
    if name != "normal":
        return pixels
    blue = np.empty(pixels.shape[:2], np.uint8)
    for source, target in zip(pixels, blue, strict=True):
        xy = source.astype(np.float32) / np.float32(127.5) - 1
        z = np.sqrt(np.clip(1 - xy[:, 0] ** 2 - xy[:, 1] ** 2, 0, 1))
        target[:] = (z * 127.5 + 128.0).astype(np.uint8)
    return np.dstack([pixels, blue])


KEPT_FROM_BYTES = 1 << 26
"""Scenes whose images decode to less are decoded again each time they are opened."""
_Size = tuple[int, int]
_Layout = tuple[Sampler, tuple[bool, Affine]]
"""Sampling of a plane: sampler, whether by the second UVs, and the transform from the vertex's UVs to the map's."""
_MapKey = tuple[MapName, str, _Size]


@dataclass(eq=False)
class _Draft:
    """A texture while maps are added to it."""

    name: str
    origin: str
    size: _Size
    category: str | None
    base: SceneImage | None = None
    maps: dict[MapName, ImageMap] = field(default_factory=dict)
    packed_hash: str = ""

    def has_plane(self, plane: Plane) -> bool:
        return any(name in self.maps for name in PLANE_COMPONENTS[plane])


_PlacedMaps = tuple[_Draft, tuple[MapName, ...], _Layout]
"""Texture that a plane of a material lies in, the maps that the material reads of it, and how it is sampled."""


def _unique(name: str, taken: dict[str, int]) -> str:
    """Return `name`, or with the first number behind it that is free; `taken` holds names and the number to try next."""
    candidate, number = name, taken.get(name, 1)
    while candidate in taken:
        number += 1
        candidate = f"{name}_{number}"
    taken[name] = number
    taken[candidate] = max(1, taken.get(candidate, 1))
    return candidate


def _folded(factors: SurfaceFactors, name: MapName, value: tuple[int, ...], notes: ReportNotes) -> SurfaceFactors:
    """Return `factors` times the map `name` that has only one `value`, 0 to 255."""
    if name == "roughness":
        return replace(factors, roughness=factors.roughness * value[0] / 255.0)
    if name == "metalness":
        return replace(factors, metalness=factors.metalness * value[0] / 255.0)
    if name == "emissive":
        linear = srgb_to_linear(np.array(value) / 255.0)
        red, green, blue = (float(share) * glow for share, glow in zip(linear, factors.emissive, strict=True))
        return replace(factors, emissive=(red, green, blue))
    if name == "occlusion" and value != (255,):
        notes.ignored("occlusion maps of one value")
    return factors


class _Gathering:
    """Puts the maps of one material after another into textures."""

    def __init__(self, images: Mapping[int, SceneImage], reader: ImageReader, notes: ReportNotes) -> None:
        self._images = images
        self._reader = reader
        self._notes = notes
        self.drafts: list[_Draft] = []
        self._of_base: dict[int, _Draft] = {}
        self._holding: dict[_MapKey, list[_Draft]] = {}
        self._resampled: dict[tuple[str, _Size], ImageMap] = {}

    def add_bases(self, categories: Mapping[int, str | None], packed: Mapping[int, str]) -> None:
        """Add a texture for each distinct base colour, in the order of the images `categories`.
        `packed`: their identities in a pack."""
        by_hash: dict[str, _Draft] = {}
        for index, category in categories.items():
            image = self._images[index]
            digest = image.facts.pixel_hash
            if not digest:
                continue
            if digest in by_hash:
                self._notes.note("images with the pixels of another share its texture")
            else:
                by_hash[digest] = _Draft(image.name, image.origin, image.facts.size, category, image)
                by_hash[digest].packed_hash = packed.get(index, "")
                self.drafts.append(by_hash[digest])
            self._of_base[index] = by_hash[digest]

    def base_of(self, source: MaterialSource) -> _Draft | None:
        """Return the texture of the material's base colour."""
        reference = source.maps.get("base")
        return None if reference is None else self._of_base.get(reference.image)

    def planes(self, source: MaterialSource) -> tuple[dict[Plane, _PlacedMaps], SurfaceFactors]:
        """Return (maps by plane besides the base colour; factors with constants in them)."""
        factors = source.material.factors
        read: dict[Plane, list[tuple[MapName, TextureReference, MapFacts]]] = {}
        for name, reference in source.maps.items():
            if name == "base":
                continue
            found = self._images[reference.image].facts.maps.get(name)
            if found is None:
                continue
            if found.constant is not None:
                factors = _folded(factors, name, found.constant, self._notes)
                became = "have no effect" if name in ("normal", "occlusion") else "became factors"
                self._notes.note(f"constant {name} maps {became}: materials")
            elif found.key:
                read.setdefault(PLANE_OF_MAP[name], []).append((name, reference, found))
        near: list[tuple[_Draft, _Layout]] = []
        base = self.base_of(source)
        if base is not None:
            near.append((base, (source.material.sampler, (False, IDENTITY))))
        placed: dict[Plane, _PlacedMaps] = {}
        for plane, maps in read.items():
            agreed = self._agreed(source, maps)
            if agreed is not None:
                wanted, layout = agreed
                names = tuple(wanted.maps)
                for name in names:
                    self._notes.honoured(f"{name} maps: materials")
                draft = self._draft(plane, wanted, layout, near)
                placed[plane] = draft, names, layout
                near.append((draft, layout))
        return placed, factors

    def _agreed(
        self, source: MaterialSource, maps: Sequence[tuple[MapName, TextureReference, MapFacts]]
    ) -> tuple[_Draft, _Layout] | None:
        """Return (the maps of one plane that can be sampled together, at one size; how); None when none can."""
        layout: _Layout | None = None
        kept: list[tuple[MapName, TextureReference, MapFacts]] = []
        for name, reference, found in maps:
            placement = source.placement(reference)
            if placement is None:
                self._notes.ignored(f"{name} maps by a third set of UVs: materials")
                continue
            if layout is None:
                layout = reference.sampler, placement
            if (reference.sampler, placement) != layout:
                first_name = kept[0][0]
                self._notes.ignored(
                    f"{name} maps whose UVs or sampler are not those of the {first_name} map: materials"
                )
                continue
            kept.append((name, reference, found))
        if layout is None:
            return None
        sizes = [self._images[reference.image].facts.size for _, reference, _ in kept]
        size = max(sizes, key=lambda each: each[0] * each[1])
        first = kept[0][1]
        image = self._images[first.image]
        at_size = {name: self._at_size(name, found, self._images[each.image], size) for name, each, found in kept}
        category = first.category or source.category
        return _Draft(image.name, image.origin, size, category, None, at_size, first.packed_hash), layout

    def _at_size(self, name: MapName, found: MapFacts, image: SceneImage, size: _Size) -> ImageMap:
        cache = self._reader.cache
        if image.facts.size == size:
            return ImageMap(image, name, found.key, size, cache)
        key = f"{name} {found.key}", size
        if key not in self._resampled:
            new_bytes = size[0] * size[1] * MAP_CHANNELS[name]
            self._reader.budget.add(0, new_bytes, new_bytes)
            self._notes.note(f"{name} maps resampled to the size of another map of their plane")
            self._resampled[key] = ImageMap(image, name, found.key, size, cache)
        return self._resampled[key]

    def _draft(self, plane: Plane, wanted: _Draft, layout: _Layout, near: Sequence[tuple[_Draft, _Layout]]) -> _Draft:
        """Return the texture that the maps of `wanted` lie in: one that has them, else one of the material's that they fit into,
        else `wanted`."""
        keys: list[_MapKey] = [(name, found.key, wanted.size) for name, found in wanted.maps.items()]
        for draft in self._holding.get(keys[0], ()):
            if all(draft in self._holding.get(key, ()) for key in keys):
                return draft
        chosen = wanted
        for draft, other in near:
            apart = draft.packed_hash and wanted.packed_hash and draft.packed_hash != wanted.packed_hash
            if draft.size == wanted.size and layout == other and not apart and not draft.has_plane(plane):
                chosen = draft
                chosen.maps |= wanted.maps
                break
        else:
            self.drafts.append(wanted)
        for key in keys:
            self._holding.setdefault(key, []).append(chosen)
        return chosen


def _finished_texture(draft: _Draft, name: str, facts: FactsFile, cache: PixelCache) -> SceneTexture:
    further: dict[MapName, ImageMap] = {key: draft.maps[key] for key in MAPS if key in draft.maps}
    base, source = draft.base, ImagesOfTexture(draft.base, further, cache)
    maps: tuple[MapName, ...] = (*(BASE_ALONE if base is not None else ()), *further)
    read = [*(found.image for found in further.values()), *([base] if base is not None else [])]
    # Of what a pack alone holds not what its pixels would give: they would have to be decoded for that.
    digest = set_hash = read[0].packed_hash
    if not digest:
        digest = base.facts.pixel_hash if base is not None else ""
        if further:
            set_hash = _set_hash(digest, draft, further, source, facts)
            digest = digest or set_hash
    return SceneTexture(
        name,
        draft.size,
        base is not None and base.facts.has_alpha,
        digest,
        draft.origin,
        source,
        draft.category,
        maps,
        set_hash,
        draft.packed_hash,
    )


def _set_hash(
    base_hash: str, draft: _Draft, further: Mapping[MapName, ImageMap], source: ImagesOfTexture, facts: FactsFile
) -> str:
    """Return the hash of all maps of a set, as it is known, else of its pixels."""
    key = " ".join([base_hash, *(f"{own} {found.key}" for own, found in further.items()), f"{draft.size}"])
    found = facts.set_hash(key)
    if found is None:
        found = source.set_hash()
    facts.add_set(key, found)
    return found


def _with_base(material: Material, image: SceneImage | None, texture_id: int) -> Material:
    if image is not None and image.failure:
        return replace(material, missing_base=True)
    constant = None if image is None else image.facts.constant
    if constant is None:
        return replace(material, texture_id=texture_id)
    red, green, blue, alpha = (f * c for f, c in zip(material.factor, constant, strict=True))
    return replace(material, factor=(red, green, blue, alpha))


def read_textures(
    file: GltfFile,
    buffers: Buffers,
    sources: Sequence[MaterialSource],
    drawn: frozenset[int],
    notes: ReportNotes,
    scene: Path | None = None,
    report: ProgressReport | None = None,
) -> tuple[tuple[Material, ...], tuple[SceneTexture, ...]]:
    """Return the finished materials, in the order of `sources`, and the textures: those with a base colour in the order in which
    materials use them, then the others.

    Only images of the materials `drawn` are read. An image that is missing or broken is reported, and factors stand for it; a
    map of one value is multiplied into the factor. What is found out about images is kept in the cache folder for `scene`, where
    that takes long. Raises InputError, and what `report` raises.
    """
    try:
        facts = FactsFile(cache_folder("images"), scene)
        found = _read(file, ImageReader(file, buffers, facts, PixelCache()), facts, sources, drawn, notes, report)
        facts.write(KEPT_FROM_BYTES)
        return found
    except TooManyPixelsError as error:
        raise file.fail("images", "hold too many texels for the bytes there are; the scene is broken") from error


def _read(
    file: GltfFile,
    reader: ImageReader,
    facts: FactsFile,
    sources: Sequence[MaterialSource],
    drawn: frozenset[int],
    notes: ReportNotes,
    report: ProgressReport | None,
) -> tuple[tuple[Material, ...], tuple[SceneTexture, ...]]:
    uses = image_uses([source for number, source in enumerate(sources) if number in drawn])
    images = find_images(file, uses, reader, notes, report)
    for index in range(len(file.entries("images"))):
        if index not in images:
            note_absent(file, index, notes)
    decoded = list({id(image): image for image in images.values()}.values())
    notes.note("constant images became factors", sum(image.facts.constant is not None for image in decoded))
    notes.honoured("alpha of textures", sum(image.facts.has_alpha for image in decoded))

    gathering = _Gathering(images, reader, notes)
    bases = [source.maps["base"] for source in sources if "base" in source.maps]
    packed = {reference.image: reference.packed_hash for reference in bases}
    gathering.add_bases({index: use.category for index, use in uses.items() if "base" in use.maps}, packed)
    planes = {number: gathering.planes(source) for number, source in enumerate(sources) if number in drawn}
    drafts = gathering.drafts
    ids = {id(draft): number for number, draft in enumerate(drafts)}
    taken: dict[str, int] = {}
    names = [_unique(draft.name, taken) for draft in drafts]
    pairs = list(zip(drafts, names, strict=True))
    textures = map_in_threads(lambda pair: _finished_texture(*pair, facts, reader.cache), pairs, report)
    notes.note("textures that are material sets", sum(texture.maps != BASE_ALONE for texture in textures))

    def finished(number: int, source: MaterialSource) -> Material:
        if number not in planes:
            return source.material
        placed, factors = planes[number]
        base = gathering.base_of(source)
        image = images.get(source.maps["base"].image) if "base" in source.maps else None
        material = _with_base(source.material, image, -1 if base is None else ids[id(base)])
        found = {
            plane: PlaneTexture(ids[id(draft)], layout[0], names, *layout[1])
            for plane, (draft, names, layout) in placed.items()
        }
        return replace(material, factors=factors, surface=found.get("surface"), emission=found.get("emission"))

    return tuple(finished(number, source) for number, source in enumerate(sources)), tuple(textures)
