"""One pixel of the picture and the pixels around it in both slots; read back when the place or the picture has changed."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec.color import linear_to_srgb8
from viewer.inspect.block_content import BlockPlace, block_content, pixel_at
from viewer.inspect.place_reader import Asked, PlaceReader
from viewer.render.renderer import Renderer
from viewer.render.resources.layout import materials_of, texture_ids_of
from viewer.state.view_state import ViewState, is_image_source

LEAST_FOOTPRINT = 1e-10
REACH = 7
"""Pixels that are shown on each side of the one in the middle."""


@dataclass(frozen=True, eq=False)
class PixelPatch:
    """One slot around the pixel."""

    linear: NDArray[np.float32]
    """[15, 15, 3] linear light; 0 outside the picture."""

    @property
    def srgb8(self) -> NDArray[np.uint8]:
        """[15, 15, 3] 8-bit sRGB."""
        return linear_to_srgb8(self.linear)

    @property
    def middle(self) -> tuple[tuple[float, ...], tuple[int, ...]]:
        """The pixel itself: linear light, and 8-bit sRGB."""
        return tuple(self.linear[REACH, REACH].tolist()), tuple(self.srgb8[REACH, REACH].tolist())


@dataclass(frozen=True)
class PatchPlace:
    """Which pixels are read back for a patch around (x, y) of a picture of `picture` (width, height) pixels."""

    x: int
    y: int
    """Counted from the upper left corner of the picture, from 0."""
    picture: tuple[int, int]

    @classmethod
    def at(cls, share: tuple[float, float], picture: tuple[int, int]) -> "PatchPlace":
        """Around a place given as shares of the picture from its upper left corner."""
        return cls(*pixel_at(share, picture), picture)

    @property
    def pixels(self) -> tuple[int, int, int, int]:
        """Left, top, right, bottom in pixels; cut off at the picture's edge."""
        width, height = self.picture
        return (
            max(self.x - REACH, 0),
            max(self.y - REACH, 0),
            min(self.x + REACH + 1, width),
            min(self.y + REACH + 1, height),
        )

    @property
    def inside(self) -> tuple[int, int, int, int]:
        """Left, top, right, bottom of these pixels, counted from the patch's own upper left corner."""
        left, top, right, bottom = self.pixels
        x, y = self.x - REACH, self.y - REACH
        return left - x, top - y, right - x, bottom - y

    @property
    def rectangle(self) -> tuple[float, float, float, float]:
        """Left, top, right, bottom of the patch as shares of the picture."""
        width, height = self.picture
        return (
            (self.x - REACH) / width,
            (self.y - REACH) / height,
            (self.x + REACH + 1) / width,
            (self.y + REACH + 1) / height,
        )

    def patch(self, read: NDArray[np.float32]) -> PixelPatch:
        """The patch whose part inside the picture is `read` [h, w, 3]."""
        side = 2 * REACH + 1
        linear = np.zeros((side, side, 3), np.float32)
        left, top, right, bottom = self.inside
        linear[top:bottom, left:right] = read
        return PixelPatch(linear)


@dataclass(frozen=True, eq=False)
class PixelContent:
    """One pixel."""

    place: PatchPlace
    a: PixelPatch | None
    """None while the slot has not been drawn."""
    b: PixelPatch | None
    material_name: str | None
    """None for the background."""
    texture_id: int
    """-1 for none."""
    texture_name: str
    uv: tuple[float, float]
    """Not wrapped."""
    lod: float | None
    """Level of detail that the surface asks for, from 0 for the largest mip; None without a texture."""
    decoders: Mapping[str, int]
    """Decoder of the texture by the source's name; -1 where nothing is decoded."""
    block_decoders: Mapping[str, int]
    """D of the pixel's block by the source's name."""


def read_pixel(
    reader: PlaceReader[PixelContent], renderer: Renderer, view: ViewState, at: tuple[float, float]
) -> PixelContent | None:
    """The pixel at `at` (shares of the picture from its upper left corner) of the last view that was drawn, or of one before.

    None where it has not been read yet.
    """
    place = PatchPlace.at(at, view.size)
    sources = tuple(dict.fromkeys(s.source for s in (view.slot_a, view.slot_b) if not is_image_source(s.source)))
    key = (place, view.camera, view.block, renderer.pair_key())
    return reader.read((renderer, sources), key, lambda: _asked(renderer, view, place, sources))


def _asked(renderer: Renderer, view: ViewState, place: PatchPlace, sources: Sequence[str]) -> Asked[PixelContent]:
    scene, decoders = renderer.scene, {source: renderer.decoders(source) for source in sources}
    block = BlockPlace.at(((place.x + 0.5) / view.size[0], (place.y + 0.5) / view.size[1]), view.block, view.size)
    patches = [renderer.picture_part(slot, place.pixels) for slot in (view.slot_a, view.slot_b)]

    def make(read: Sequence[NDArray[Any]]) -> PixelContent:
        in_block, drawn = read[0], iter(read[1:])
        words = np.ascontiguousarray(in_block[place.y - block.pixels[1], place.x - block.pixels[0]], np.uint32)
        texture_id, material = int(texture_ids_of(words[:1])[0]), int(materials_of(words[:1])[0])
        u, v, footprint = words[1:].view(np.float32).tolist() if material >= 0 else (0.0, 0.0, 0.0)
        texture = scene.textures[texture_id] if texture_id >= 0 else None
        content = block_content(texture_ids_of(in_block[..., 0]), block, scene, decoders)
        a, b = (None if part is None else place.patch(next(drawn)[..., :3]) for part in patches)
        return PixelContent(
            place=place,
            a=a,
            b=b,
            material_name=scene.materials[material].name if material >= 0 else None,
            texture_id=texture_id,
            texture_name=texture.name if texture is not None else "",
            uv=(u, v),
            lod=math.log2(max(footprint * texture.size[0], LEAST_FOOTPRINT)) if texture is not None else None,
            decoders={source: table[texture_id] if texture_id >= 0 else -1 for source, table in decoders.items()},
            block_decoders={source: content.decoder_count(source) for source in sources},
        )

    drawn = (part for part in patches if part is not None)
    return Asked((renderer.visibility.words_in(block.pixels), *drawn), make)
