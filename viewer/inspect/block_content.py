"""The textures in one block of the picture with their decoders; read back when the block or the picture has changed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec.model import Pack
from viewer.inspect.place_reader import Asked, PlaceReader
from viewer.render.renderer import Renderer
from viewer.render.resources.layout import texture_ids_of
from viewer.scene.model import Scene
from viewer.state.view_state import ViewState, is_image_source


def pixel_at(share: tuple[float, float], picture: tuple[int, int]) -> tuple[int, int]:
    """(x, y) of the pixel at a place given as shares of a picture of `picture` (width, height) pixels; the nearest one inside."""
    x, y = (min(max(int(value * side), 0), side - 1) for value, side in zip(share, picture, strict=True))
    return x, y


@dataclass(frozen=True)
class BlockPlace:
    """Where a block is in a picture of `picture` (width, height) pixels."""

    column: int
    row: int
    """Counted from the upper left corner of the picture, from 0."""
    block: tuple[int, int]
    """(width, height) in pixels."""
    picture: tuple[int, int]

    @classmethod
    def at(cls, share: tuple[float, float], block: tuple[int, int], picture: tuple[int, int]) -> "BlockPlace":
        """The block in which a place lies, given as shares of the picture from its upper left corner."""
        x, y = pixel_at(share, picture)
        return cls(x // block[0], y // block[1], block, picture)

    @property
    def pixels(self) -> tuple[int, int, int, int]:
        """Left, top, right, bottom in pixels from the upper left corner; cut off at the picture's edge."""
        left, top = self.column * self.block[0], self.row * self.block[1]
        return left, top, min(left + self.block[0], self.picture[0]), min(top + self.block[1], self.picture[1])

    @property
    def rectangle(self) -> tuple[float, float, float, float]:
        """The same as shares of the picture."""
        left, top, right, bottom = self.pixels
        width, height = self.picture
        return left / width, top / height, right / width, bottom / height


@dataclass(frozen=True)
class BlockTexture:
    """One texture in a block."""

    texture_id: int
    name: str
    pixels: int
    """Pixels of the block that show it."""
    decoders: Mapping[str, int]
    """Decoder of the texture by the source's name; -1 where nothing is decoded."""


@dataclass(frozen=True)
class BlockContent:
    """One block."""

    place: BlockPlace
    textures: tuple[BlockTexture, ...]
    """Most pixels first."""

    def decoder_count(self, source: str) -> int:
        """D of the block under a source's grouping."""
        return len({texture.decoders.get(source, -1) for texture in self.textures} - {-1})


def block_content(
    ids: NDArray[np.int32],
    place: BlockPlace,
    scene: Scene,
    decoders: Mapping[str, tuple[int, ...]],
) -> BlockContent:
    """Content of the block at `place` whose texture ids are `ids` [h, w], -1 for none.

    `decoders` gives for each source the decoder of every texture.
    """
    found, counts = np.unique(ids[ids >= 0], return_counts=True)
    textures = [
        BlockTexture(
            texture_id=texture_id,
            name=scene.textures[texture_id].name,
            pixels=pixels,
            decoders={source: table[texture_id] for source, table in decoders.items()},
        )
        for texture_id, pixels in zip(found.tolist(), counts.tolist(), strict=True)
    ]
    in_order = tuple(sorted(textures, key=lambda texture: (-texture.pixels, texture.texture_id)))
    return BlockContent(place, in_order)


def read_block(
    reader: PlaceReader[BlockContent],
    renderer: Renderer,
    packs: Mapping[str, Pack],
    view: ViewState,
    at: tuple[float, float],
) -> BlockContent | None:
    """The block at `at` (shares of the picture from its upper left corner) of the last view that was drawn, or of one before.

    None where it has not been read yet.
    """
    place = BlockPlace.at(at, view.block, view.size)
    sources = [slot.source for slot in (view.slot_a, view.slot_b) if not is_image_source(slot.source)]

    def ask() -> Asked[BlockContent]:
        scene, decoders = renderer.scene, {source: renderer.decoders(source) for source in sources}

        def make(read: Sequence[NDArray[Any]]) -> BlockContent:
            return block_content(texture_ids_of(read[0][..., 0]), place, scene, decoders)

        return Asked((renderer.visibility.words_in(place.pixels),), make)

    return reader.read((renderer, sources), (packs, view.camera, place), ask)
