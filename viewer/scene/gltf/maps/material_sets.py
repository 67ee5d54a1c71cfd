"""Finished materials: their maps joined into textures, constant maps multiplied into factors.

A material set is a texture of several maps that share size, UVs and sampler: they are encoded together and decoded by one code.
Maps are joined in three steps, material after material:

1. Each distinct base colour, by the hash of its pixels, starts a texture.
2. The maps of a plane (`ntc.codec.maps`) that share UVs and sampler are brought to the size of the largest.
3. A plane joins a texture that already holds the same maps; else a texture of the same material with equal size, UVs and sampler
   in which the plane is free; else it becomes a texture.

Every map therefore lies in one texture at each size, however many materials read it, and nothing is encoded twice.
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
    """Map of an image at the size of its texture. Equal values mean equal pixels."""

    image: SceneImage
    name: MapName
    key: str
    """Identity of the pixels before they are resampled."""
    size: tuple[int, int]
    """(width, height) in texels of the texture."""
    cache: PixelCache

    def pixels(self) -> NDArray[np.uint8]:
        """Return [H, W, channels of the map]. Raises InputError."""
        stored = self.image.read().maps.get(self.name)
        if stored is None:
            raise InputError(f"{self.image.origin}: has changed since the scene was opened; open it again")
        if self.image.facts.size == self.size:
            return stored
        original = stored
        return self.cache.get(self, lambda: resampled(original, *self.size))


@dataclass(frozen=True, eq=False)
class ImagesOfTexture:
    """The pixels of one texture, read from its images (`viewer.scene.pixels.TexturePixels`)."""

    base: SceneImage | None
    maps: Mapping[MapName, ImageMap]
    cache: PixelCache

    def picture(self) -> NDArray[np.uint8]:
        """Return [H, W, 3] uint8 sRGB: the base colour; of a set without one a picture of its first map."""
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
    """Maps of a texture. The image of a map is read when the map is looked up."""

    def __init__(self, maps: Mapping[MapName, ImageMap]) -> None:
        self._maps = maps

    def __getitem__(self, name: MapName) -> NDArray[np.uint8]:
        return self._maps[name].pixels()

    def __iter__(self) -> Iterator[MapName]:
        return iter(self._maps)

    def __len__(self) -> int:
        return len(self._maps)


def _picture(name: MapName, pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a picture [H, W, 3] uint8 of a map [H, W, C]: normals with z of a unit vector, single channels as grey."""
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


CACHED_FROM_BYTES = 1 << 26
"""Decoded bytes from which on the facts of a scene's images are cached on disk. Smaller scenes open fast without."""
_Size = tuple[int, int]
_Layout = tuple[Sampler, tuple[bool, Affine]]
"""Sampling of a plane: sampler, whether it reads the second UVs, and the transform from the vertex's UVs to the map's."""
_MapKey = tuple[MapName, str, _Size]


@dataclass(eq=False)
class _TextureBuilder:
    """Texture that maps are still added to."""

    name: str
    origin: str
    size: _Size
    category: str | None
    base: SceneImage | None = None
    maps: dict[MapName, ImageMap] = field(default_factory=dict)
    packed_hash: str = ""

    def has_plane(self, plane: Plane) -> bool:
        return any(name in self.maps for name in PLANE_COMPONENTS[plane])


_PlacedMaps = tuple[_TextureBuilder, tuple[MapName, ...], _Layout]
"""Texture that holds a plane of a material, the maps that the material reads of it, and its sampling."""


def _unique(name: str, taken: dict[str, int]) -> str:
    """Return `name`, with a number appended where it is in `taken`, which holds names and the last number tried for each."""
    candidate, number = name, taken.get(name, 1)
    while candidate in taken:
        number += 1
        candidate = f"{name}_{number}"
    taken[name] = number
    taken[candidate] = max(1, taken.get(candidate, 1))
    return candidate


def _folded(factors: SurfaceFactors, name: MapName, value: tuple[int, ...], notes: ReportNotes) -> SurfaceFactors:
    """Return `factors` multiplied by the constant map `name`, whose texels all have `value`, 0 to 255."""
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
    """Joins the maps of materials, one after another, into textures."""

    def __init__(self, images: Mapping[int, SceneImage], reader: ImageReader, notes: ReportNotes) -> None:
        self._images = images
        self._reader = reader
        self._notes = notes
        self.drafts: list[_TextureBuilder] = []
        self._of_base: dict[int, _TextureBuilder] = {}
        self._holding: dict[_MapKey, list[_TextureBuilder]] = {}
        self._resampled: dict[tuple[str, _Size], ImageMap] = {}

    def add_bases(self, categories: Mapping[int, str | None], packed: Mapping[int, str]) -> None:
        """Add a texture for each distinct base colour, in the order of `categories`, the category of each image.
        `packed`: the identity in a pack of each image that has one."""
        by_hash: dict[str, _TextureBuilder] = {}
        for index, category in categories.items():
            image = self._images[index]
            digest = image.facts.pixel_hash
            if not digest:
                continue
            if digest in by_hash:
                self._notes.note("images with the pixels of another share its texture")
            else:
                by_hash[digest] = _TextureBuilder(image.name, image.origin, image.facts.size, category, image)
                by_hash[digest].packed_hash = packed.get(index, "")
                self.drafts.append(by_hash[digest])
            self._of_base[index] = by_hash[digest]

    def base_of(self, source: MaterialSource) -> _TextureBuilder | None:
        """Return the texture of the material's base colour."""
        reference = source.maps.get("base")
        return None if reference is None else self._of_base.get(reference.image)

    def planes(self, source: MaterialSource) -> tuple[dict[Plane, _PlacedMaps], SurfaceFactors]:
        """Return (maps by plane, without the base colour; factors of the material times its constant maps)."""
        factors = source.material.factors
        read: dict[Plane, list[tuple[MapName, TextureReference, MapFacts]]] = {}
        for name, reference in source.maps.items():
            if name == "base":
                continue
            facts = self._images[reference.image].facts.maps.get(name)
            if facts is None:
                continue
            if facts.constant is not None:
                factors = _folded(factors, name, facts.constant, self._notes)
                became = "have no effect" if name in ("normal", "occlusion") else "became factors"
                self._notes.note(f"constant {name} maps {became}: materials")
            elif facts.key:
                read.setdefault(PLANE_OF_MAP[name], []).append((name, reference, facts))
        of_material: list[tuple[_TextureBuilder, _Layout]] = []
        base = self.base_of(source)
        if base is not None:
            of_material.append((base, (source.material.sampler, (False, IDENTITY))))
        placed: dict[Plane, _PlacedMaps] = {}
        for plane, maps in read.items():
            agreed = self._agreed(source, maps)
            if agreed is not None:
                candidate, layout = agreed
                names = tuple(candidate.maps)
                for name in names:
                    self._notes.honoured(f"{name} maps: materials")
                draft = self._draft(plane, candidate, layout, of_material)
                placed[plane] = draft, names, layout
                of_material.append((draft, layout))
        return placed, factors

    def _agreed(
        self, source: MaterialSource, maps: Sequence[tuple[MapName, TextureReference, MapFacts]]
    ) -> tuple[_TextureBuilder, _Layout] | None:
        """Return (the maps of one plane that can be sampled together, at one size; their sampling); None when none can."""
        layout: _Layout | None = None
        compatible: list[tuple[MapName, TextureReference, MapFacts]] = []
        for name, reference, facts in maps:
            placement = source.placement(reference)
            if placement is None:
                self._notes.ignored(f"{name} maps by a third set of UVs: materials")
                continue
            if layout is None:
                layout = reference.sampler, placement
            if (reference.sampler, placement) != layout:
                first_name = compatible[0][0]
                self._notes.ignored(
                    f"{name} maps whose UVs or sampler are not those of the {first_name} map: materials"
                )
                continue
            compatible.append((name, reference, facts))
        if layout is None:
            return None
        sizes = [self._images[reference.image].facts.size for _, reference, _ in compatible]
        size = max(sizes, key=lambda each: each[0] * each[1])
        first = compatible[0][1]
        image = self._images[first.image]
        at_size = {name: self._at_size(name, facts, self._images[each.image], size) for name, each, facts in compatible}
        category = first.category or source.category
        return _TextureBuilder(image.name, image.origin, size, category, None, at_size, first.packed_hash), layout

    def _at_size(self, name: MapName, facts: MapFacts, image: SceneImage, size: _Size) -> ImageMap:
        cache = self._reader.cache
        if image.facts.size == size:
            return ImageMap(image, name, facts.key, size, cache)
        key = f"{name} {facts.key}", size
        if key not in self._resampled:
            new_bytes = size[0] * size[1] * MAP_CHANNELS[name]
            self._reader.budget.add(0, new_bytes, new_bytes)
            self._notes.note(f"{name} maps resampled to the size of another map of their plane")
            self._resampled[key] = ImageMap(image, name, facts.key, size, cache)
        return self._resampled[key]

    def _draft(
        self,
        plane: Plane,
        candidate: _TextureBuilder,
        layout: _Layout,
        of_material: Sequence[tuple[_TextureBuilder, _Layout]],
    ) -> _TextureBuilder:
        """Return the texture for the maps of `candidate`: one that has them already, else one of `of_material` that they fit
        into, else `candidate`."""
        keys: list[_MapKey] = [(name, each.key, candidate.size) for name, each in candidate.maps.items()]
        for draft in self._holding.get(keys[0], ()):
            if all(draft in self._holding.get(key, ()) for key in keys):
                return draft
        chosen = candidate
        for draft, other in of_material:
            apart = draft.packed_hash and candidate.packed_hash and draft.packed_hash != candidate.packed_hash
            if draft.size == candidate.size and layout == other and not apart and not draft.has_plane(plane):
                chosen = draft
                chosen.maps |= candidate.maps
                break
        else:
            self.drafts.append(candidate)
        for key in keys:
            self._holding.setdefault(key, []).append(chosen)
        return chosen


def _finished_texture(draft: _TextureBuilder, name: str, facts: FactsFile, cache: PixelCache) -> SceneTexture:
    further: dict[MapName, ImageMap] = {key: draft.maps[key] for key in MAPS if key in draft.maps}
    base, source = draft.base, ImagesOfTexture(draft.base, further, cache)
    maps: tuple[MapName, ...] = (*(BASE_ALONE if base is not None else ()), *further)
    read = [*(each.image for each in further.values()), *([base] if base is not None else [])]
    # Images that only a pack holds are identified by the pack's hash: hashing their pixels would need decoding.
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
    base_hash: str,
    draft: _TextureBuilder,
    further: Mapping[MapName, ImageMap],
    source: ImagesOfTexture,
    facts: FactsFile,
) -> str:
    """Return the hash of all maps of a set, from the cache or from the pixels."""
    key = " ".join([base_hash, *(f"{name} {each.key}" for name, each in further.items()), f"{draft.size}"])
    digest = facts.set_hash(key)
    if digest is None:
        digest = source.set_hash()
    facts.add_set(key, digest)
    return digest


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
    """Return (finished materials, in the order of `sources`; textures: first those with a base colour, in the order in which
    materials use them).

    Only images of the materials `drawn` are read. A missing or broken image is reported, and the factor is used alone. A constant
    map is multiplied into its factor. Facts of images that took long to decode are cached on disk for the file `scene`. Raises
    InputError, and the exceptions of `report`.
    """
    try:
        facts = FactsFile(cache_folder("images"), scene)
        result = _read(file, ImageReader(file, buffers, facts, PixelCache()), facts, sources, drawn, notes, report)
        facts.write(CACHED_FROM_BYTES)
        return result
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
        textures_by_plane = {
            plane: PlaneTexture(ids[id(draft)], layout[0], names, *layout[1])
            for plane, (draft, names, layout) in placed.items()
        }
        return replace(
            material,
            factors=factors,
            surface=textures_by_plane.get("surface"),
            emission=textures_by_plane.get("emission"),
        )

    return tuple(finished(number, source) for number, source in enumerate(sources)), tuple(textures)
