"""Places of the images of one plane of maps in texture arrays, within a memory budget.

A shader can sample all layers of an array, so images of equal size and sampler share arrays, and few arrays have to be drawn.

If all images fit into the budget, each has a permanent layer. Else only images of visible materials have one, and their size is
bounded: the side is the largest power of two such that all of them fit, and finer mips are left out. When the visible materials
change, `want` keeps the images that are fine enough, and drops others, the least recently visible first, until the missing ones fit. A
new layer is pending until its image has been uploaded; meanwhile the coarser image of the texture is shown, if there is one. If the
images together exceed the budget because some are finer than now allowed, those are replaced by coarser ones as well.
"""

from collections import OrderedDict, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from ntc.codec.maps import PLANES, Plane
from viewer.scene.model import Sampler, Scene

LAYERS_AT_MOST = 256
"""Most layers of an array. Every OpenGL 4.3 driver allows at least so many."""
ARRAY_BYTES = 1 << 24
"""Size in bytes of an array within a bounded budget, unless one layer takes more. It is small because unused layers waste memory."""
DEFAULT_BYTES = 1 << 30
"""Default budget for all images of one source, in bytes."""
TEXEL_BYTES = 4

_Key = tuple[int, Sampler]
"""Texture and its sampler."""


@dataclass(frozen=True)
class ImagePlace:
    """Place of an image that materials sample."""

    array: int
    layer: int


@dataclass(frozen=True)
class ImageContent:
    """Content of a layer: a texture, from mip `level` on."""

    texture: int
    level: int = 0
    number: int = 0
    """Number that distinguishes contents which a place has at different times."""


@dataclass(frozen=True, eq=False)
class ImageArrayPlan:
    """Plan of a texture array: images of one size and one sampler."""

    size: tuple[int, int]
    sampler: Sampler
    layers: int


def image_bytes(size: tuple[int, int]) -> int:
    """Return the number of bytes of an image of (width, height) texels with its mips."""
    return size[0] * size[1] * TEXEL_BYTES * 4 // 3


def plane_bytes(scene: Scene, plane: Plane) -> int:
    """Return the number of bytes of all images of a plane; an image with several samplers counts for each."""
    return sum(image_bytes(scene.textures[texture].size) for texture, _ in set(_keys(scene, plane).values()))


def _keys(scene: Scene, plane: Plane) -> dict[int, _Key]:
    """Return the plane's texture and sampler by material."""
    textures = {index: material.plane(plane) for index, material in enumerate(scene.materials)}
    return {index: (each.texture_id, each.sampler) for index, each in textures.items() if each is not None}


def _reduced(size: tuple[int, int], level: int) -> tuple[int, int]:
    return max(1, size[0] >> level), max(1, size[1] >> level)


def _level(size: tuple[int, int], side: int) -> int:
    """Return the first mip of at most `side` texels a side."""
    return max(0, (max(size) - 1).bit_length() - (side - 1).bit_length())


class ImagePlaces:
    """Places of a plane's images. All image sources share them.

    If all images fit into `most_bytes`, the places are permanent. Else only images in sight have places, at the largest size at which
    all of them fit. A new or finer image is pending until `arrived` is called.
    """

    def __init__(self, scene: Scene, plane: Plane, most_bytes: int = DEFAULT_BYTES) -> None:
        self._scene, self._plane, self._most_bytes = scene, PLANES.index(plane), most_bytes
        self._keys = _keys(scene, plane)
        self.is_bounded = plane_bytes(scene, plane) > most_bytes
        self.plans: dict[int, ImageArrayPlan] = {}
        """Plans of the arrays, by number."""
        self.content: dict[ImagePlace, ImageContent] = {}
        self._current: OrderedDict[_Key, ImagePlace] = OrderedDict()
        """Places of shown images, from the least to the most recently visible."""
        self._pending: dict[_Key, ImagePlace] = {}
        self._free: dict[int, list[int]] = {}
        """Layers without content, by array."""
        self._bytes = self._placed = 0
        self._wanted: frozenset[_Key] = frozenset()
        self.version = 0
        """Version that changes whenever places or pending images change."""
        self.side = max((max(scene.textures[texture].size) for texture, _ in self._keys.values()), default=1)
        """Size limit of the images in sight: their largest side in texels."""
        if not self.is_bounded:
            self._place_all()

    def _place_all(self) -> None:
        members: dict[tuple[tuple[int, int], Sampler], list[_Key]] = defaultdict(list)
        for key in dict.fromkeys(self._keys.values()):
            members[(self._scene.textures[key[0]].size, key[1])].append(key)
        for (size, sampler), keys in members.items():
            for start in range(0, len(keys), LAYERS_AT_MOST):
                part = keys[start : start + LAYERS_AT_MOST]
                self.plans[len(self.plans)] = ImageArrayPlan(size, sampler, len(part))
                for layer, key in enumerate(part):
                    place = ImagePlace(len(self.plans) - 1, layer)
                    self._current[key], self.content[place] = place, ImageContent(key[0])

    @property
    def images(self) -> int:
        """Number of images of the plane."""
        return len(set(self._keys.values()))

    @property
    def pending(self) -> Mapping[ImagePlace, ImageContent]:
        """Content that is not uploaded yet, by place."""
        return {place: self.content[place] for place in self._pending.values()}

    @property
    def in_sight(self) -> int:
        """Number of images in sight; 0 if the budget holds all images."""
        return len(self._wanted)

    def of(self, materials: Iterable[int]) -> set[ImagePlace]:
        """Return the places of the uploaded images of `materials`."""
        keys = {self._keys[index] for index in materials if index in self._keys}
        return {self._current[key] for key in keys if key in self._current}

    def want(self, materials: Iterable[int]) -> None:
        """Give places to the images of these visible materials; others lose theirs if room is needed."""
        if not self.is_bounded:
            return
        wanted = frozenset(self._keys[index] for index in materials if index in self._keys)
        if wanted == self._wanted:
            return
        self._wanted = wanted
        self.version += 1
        for key in [key for key in self._pending if key not in wanted]:
            self._drop(self._pending.pop(key))
        self.side = self._fitting_side(wanted)
        levels = {key: _level(self._scene.textures[key[0]].size, self.side) for key in wanted}
        placed_bytes = 0
        missing: list[_Key] = []
        for key in sorted(wanted, key=lambda each: each[0]):
            place = self._pending.get(key, self._current.get(key))
            if key in self._current:
                self._current.move_to_end(key)
            if place is None or self.content[place].level > levels[key]:
                missing.append(key)
            else:
                placed_bytes += self._bytes_of(place)
        needed = sum(self._size_bytes(key, levels[key]) for key in missing)
        if placed_bytes + needed > self._most_bytes:
            # Some images are finer than the new limit, so they are replaced by coarser ones.
            missing = [key for key in wanted if not self._is_at(key, levels[key])]
            needed = sum(self._size_bytes(key, levels[key]) for key in missing)
        for key in missing:
            if key in self._pending:
                self._drop(self._pending.pop(key))
        self._make_room(needed, set(missing))
        for key in sorted(missing, key=lambda each: each[0]):
            self._pending[key] = self._placed_at(key, levels[key])

    def _is_at(self, key: _Key, level: int) -> bool:
        place = self._pending.get(key, self._current.get(key))
        return place is not None and self.content[place].level == level

    def _fitting_side(self, wanted: Iterable[_Key]) -> int:
        sizes = [self._scene.textures[texture].size for texture, _ in wanted]
        side = 1 << (max((max(size) for size in sizes), default=1) - 1).bit_length()
        while side > 1 and sum(image_bytes(_reduced(size, _level(size, side))) for size in sizes) > self._most_bytes:
            side //= 2
        return side

    def _size_bytes(self, key: _Key, level: int) -> int:
        return image_bytes(_reduced(self._scene.textures[key[0]].size, level))

    def _bytes_of(self, place: ImagePlace) -> int:
        return image_bytes(self.plans[place.array].size)

    def _make_room(self, needed: int, coming: set[_Key]) -> None:
        """Drop images until `needed` bytes fit: those out of sight, then those of `coming`, the least recently visible first."""
        for key in [key for key in self._current if key not in self._wanted] + [
            key for key in self._current if key in coming
        ]:
            if self._bytes + needed <= self._most_bytes:
                return
            self._drop(self._current.pop(key))

    def _drop(self, place: ImagePlace) -> None:
        self._bytes -= self._bytes_of(place)
        del self.content[place]
        free = self._free[place.array]
        free.append(place.layer)
        if len(free) == self.plans[place.array].layers:
            del self.plans[place.array], self._free[place.array]

    def _placed_at(self, key: _Key, level: int) -> ImagePlace:
        size = _reduced(self._scene.textures[key[0]].size, level)
        fitting = (array for array, free in self._free.items() if free)
        number = next(
            (array for array in fitting if (self.plans[array].size, self.plans[array].sampler) == (size, key[1])), None
        )
        if number is None:
            layers = min(LAYERS_AT_MOST, max(1, ARRAY_BYTES // image_bytes(size)))
            number = next(unused for unused in range(len(self.plans) + 1) if unused not in self.plans)
            self.plans[number] = ImageArrayPlan(size, key[1], layers)
            self._free[number] = list(range(layers))
        self._placed += 1
        place = ImagePlace(number, self._free[number].pop())
        self.content[place] = ImageContent(key[0], level, self._placed)
        self._bytes += self._bytes_of(place)
        return place

    def arrived(self, places: Iterable[ImagePlace]) -> None:
        """Show the images that were uploaded to these places, and drop the coarser ones that they replace."""
        there = set(places)
        self.version += 1
        for key in [key for key, place in self._pending.items() if place in there]:
            before = self._current.get(key)
            self._current[key] = self._pending.pop(key)
            if before is not None:
                self._drop(before)

    def write(self, records: np.ndarray) -> None:
        """Write the places into the materials' records (`MATERIAL_RECORD`); array -1: no image."""
        for index, key in self._keys.items():
            plane_record, place = records[index]["planes"][self._plane], self._current.get(key)
            plane_record["image_array"], plane_record["image_layer"] = (
                (-1, 0) if place is None else (place.array, place.layer)
            )
