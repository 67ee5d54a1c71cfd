"""Picking: the pixel and the framebuffer block under the mouse, read back from the GPU when the mouse moves or the picture changes."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from ntc.codec.mips import linear_to_srgb8
from ntc.codec.model import Pack
from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.read_back import PicturePart, ReadBack
from viewer.render.renderer import Renderer
from viewer.render.resources.layout import materials_of, texture_ids_of
from viewer.scene.model import Scene
from viewer.state.view_state import ViewState, is_image_source

Content = TypeVar("Content")


@dataclass(frozen=True, eq=False)
class ReadRequest(Generic[Content]):
    """Request to read back parts of pictures."""

    parts: Sequence[PicturePart]
    make: Callable[[Sequence[NDArray[Any]]], Content]
    """Function that makes the content from the arrays of the parts (`PicturePart.array`)."""


class PlaceReader(Generic[Content]):
    """Reader of the picture at a place. The content is one or two frames older than a moving picture, unless frames wait for it."""

    def __init__(self, context: GraphicsContext, what: str) -> None:
        """Make a reader; `what` names it where GPU memory runs out."""
        self._context = context
        self._back = ReadBack[ReadRequest[Content]](context, what)
        self._subject: object = None
        self._key: object = None
        self._content: Content | None = None
        self.reads = 0
        """Number of requests so far."""

    @property
    def is_pending(self) -> bool:
        """True while newer content is on its way."""
        return self._back.is_pending

    def read(self, subject: object, key: object, ask: Callable[[], ReadRequest[Content]]) -> Content | None:
        """Return the latest content; None before there is any.

        `ask` makes the request. It is called when `key` has changed. Content of another `subject` is dropped. Raises ContextLostError.
        """
        if subject != self._subject:
            self.forget()
            self._subject = subject
        if key != self._key:
            request = ask()
            self._key = key
            self.reads += 1
            try:
                self._back.copy_parts(request.parts, request)
            except GpuMemoryError:
                # There is no memory for a copy: this frame waits for the read-back.
                self._back.drop()
                self._make(request, [part.read() for part in request.parts])
        arrived = self._back.arrived(self._context.waits)
        if arrived is not None:
            content, request = arrived
            read, at = list[NDArray[Any]](), 0
            for part in request.parts:
                read.append(part.array(content[at : at + part.byte_count]))
                at += part.byte_count
            self._make(request, read)
        return self._content

    def _make(self, request: ReadRequest[Content], read: Sequence[NDArray[Any]]) -> None:
        # Data of a lost context is void, and may name textures that do not exist.
        self._context.reset.check()
        self._content = request.make(read)

    def forget(self) -> None:
        """Drop the content and any request under way."""
        self._back.drop()
        self._subject = self._key = self._content = None

    def release(self) -> None:
        """Free the buffers."""
        self.forget()
        self._back.release()


def pixel_at(share: tuple[float, float], picture: tuple[int, int]) -> tuple[int, int]:
    """Return the pixel (x, y) nearest to a place given as shares of a picture of `picture` (width, height) pixels."""
    x, y = (min(max(int(value * side), 0), side - 1) for value, side in zip(share, picture, strict=True))
    return x, y


@dataclass(frozen=True)
class BlockPlace:
    """Place of a block in a picture of `picture` (width, height) pixels."""

    column: int
    row: int
    """Place from the upper left corner of the picture, from 0."""
    block: tuple[int, int]
    """(width, height) in pixels."""
    picture: tuple[int, int]

    @classmethod
    def at(cls, share: tuple[float, float], block: tuple[int, int], picture: tuple[int, int]) -> "BlockPlace":
        """Return the block at a place given as shares of the picture from its upper left corner."""
        x, y = pixel_at(share, picture)
        return cls(x // block[0], y // block[1], block, picture)

    @property
    def pixels(self) -> tuple[int, int, int, int]:
        """Rectangle (left, top, right, bottom) in pixels from the upper left corner, cut off at the picture's edge."""
        left, top = self.column * self.block[0], self.row * self.block[1]
        return left, top, min(left + self.block[0], self.picture[0]), min(top + self.block[1], self.picture[1])

    @property
    def rectangle(self) -> tuple[float, float, float, float]:
        """Rectangle (left, top, right, bottom) as shares of the picture."""
        left, top, right, bottom = self.pixels
        width, height = self.picture
        return left / width, top / height, right / width, bottom / height


@dataclass(frozen=True)
class BlockTexture:
    """Texture that pixels of a framebuffer block show."""

    texture_id: int
    name: str
    pixels: int
    """Number of pixels of the block that show the texture."""
    decoders: Mapping[str, int]
    """Decoder of the texture by the source's name; -1 where nothing is decoded."""


@dataclass(frozen=True)
class BlockContent:
    """Content of a framebuffer block: its textures and their decoders."""

    place: BlockPlace
    textures: tuple[BlockTexture, ...]
    """Textures in the block, most pixels first."""

    def decoder_count(self, source: str) -> int:
        """Return the number of different decoders in the block for a source's grouping."""
        return len({texture.decoders.get(source, -1) for texture in self.textures} - {-1})


def block_content(
    ids: NDArray[np.int32],
    place: BlockPlace,
    scene: Scene,
    decoders: Mapping[str, tuple[int, ...]],
) -> BlockContent:
    """Return the content of the block at `place` with texture ids `ids` [h, w], -1 for none.

    `decoders` has the decoder of every texture, by source.
    """
    texture_ids, counts = np.unique(ids[ids >= 0], return_counts=True)
    textures = [
        BlockTexture(
            texture_id=texture_id,
            name=scene.textures[texture_id].name,
            pixels=pixels,
            decoders={source: table[texture_id] for source, table in decoders.items()},
        )
        for texture_id, pixels in zip(texture_ids.tolist(), counts.tolist(), strict=True)
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
    """Read the block at `at` (shares of the picture from its upper left corner) of the last view or of a recent one.

    Returns None until the first read-back has arrived.
    """
    place = BlockPlace.at(at, view.block, view.size)
    sources = [slot.source for slot in (view.slot_a, view.slot_b) if not is_image_source(slot.source)]

    def ask() -> ReadRequest[BlockContent]:
        scene, decoders = renderer.scene, {source: renderer.decoders(source) for source in sources}

        def make(read: Sequence[NDArray[Any]]) -> BlockContent:
            return block_content(texture_ids_of(read[0][..., 0]), place, scene, decoders)

        return ReadRequest((renderer.visibility.words_in(place.pixels),), make)

    return reader.read((renderer, sources), (packs, view.camera, place), ask)


LEAST_FOOTPRINT = 1e-10
REACH = 7
"""Number of pixels shown on each side of the middle one."""


@dataclass(frozen=True, eq=False)
class PixelPatch:
    """Pixels of one slot around a pixel."""

    linear: NDArray[np.float32]
    """Pixels in linear light [15, 15, 3]; 0 outside the picture."""

    @property
    def srgb8(self) -> NDArray[np.uint8]:
        """Pixels in 8-bit sRGB [15, 15, 3]."""
        return linear_to_srgb8(self.linear)

    @property
    def middle(self) -> tuple[tuple[float, ...], tuple[int, ...]]:
        """Middle pixel: linear light, and 8-bit sRGB."""
        return tuple(self.linear[REACH, REACH].tolist()), tuple(self.srgb8[REACH, REACH].tolist())


@dataclass(frozen=True)
class PatchPlace:
    """Place of a patch around (x, y) in a picture of `picture` (width, height) pixels."""

    x: int
    y: int
    """Place from the upper left corner of the picture, from 0."""
    picture: tuple[int, int]

    @classmethod
    def at(cls, share: tuple[float, float], picture: tuple[int, int]) -> "PatchPlace":
        """Return the patch around a place given as shares of the picture from its upper left corner."""
        return cls(*pixel_at(share, picture), picture)

    @property
    def pixels(self) -> tuple[int, int, int, int]:
        """Rectangle (left, top, right, bottom) in pixels, cut off at the picture's edge."""
        width, height = self.picture
        return (
            max(self.x - REACH, 0),
            max(self.y - REACH, 0),
            min(self.x + REACH + 1, width),
            min(self.y + REACH + 1, height),
        )

    @property
    def inside(self) -> tuple[int, int, int, int]:
        """Rectangle `pixels`, relative to the patch's upper left corner."""
        left, top, right, bottom = self.pixels
        x, y = self.x - REACH, self.y - REACH
        return left - x, top - y, right - x, bottom - y

    @property
    def rectangle(self) -> tuple[float, float, float, float]:
        """Rectangle (left, top, right, bottom) of the whole patch as shares of the picture."""
        width, height = self.picture
        return (
            (self.x - REACH) / width,
            (self.y - REACH) / height,
            (self.x + REACH + 1) / width,
            (self.y + REACH + 1) / height,
        )

    def patch(self, read: NDArray[np.float32]) -> PixelPatch:
        """Return the patch whose part inside the picture is `read` [h, w, 3]."""
        side = 2 * REACH + 1
        linear = np.zeros((side, side, 3), np.float32)
        left, top, right, bottom = self.inside
        linear[top:bottom, left:right] = read
        return PixelPatch(linear)


@dataclass(frozen=True, eq=False)
class PixelContent:
    """Content of a pixel: its surroundings in A and B, its material, texture and decoders."""

    place: PatchPlace
    a: PixelPatch | None
    """Pixels of slot A around it; None before the slot is drawn."""
    b: PixelPatch | None
    material_name: str | None
    """Name of the material; None for the background."""
    texture_id: int
    """Id of the texture; -1 for none."""
    texture_name: str
    uv: tuple[float, float]
    """Texture coordinates, not wrapped."""
    lod: float | None
    """Level of detail that the surface needs, from 0 for the largest mip; None without a texture."""
    decoders: Mapping[str, int]
    """Decoder of the texture by the source's name; -1 where nothing is decoded."""
    block_decoders: Mapping[str, int]
    """Number of different decoders in the pixel's block by the source's name."""


def read_pixel(
    reader: PlaceReader[PixelContent], renderer: Renderer, view: ViewState, at: tuple[float, float]
) -> PixelContent | None:
    """Read the pixel at `at` (shares of the picture from its upper left corner) of the last view or of a recent one.

    Returns None until the first read-back has arrived.
    """
    place = PatchPlace.at(at, view.size)
    sources = tuple(dict.fromkeys(s.source for s in (view.slot_a, view.slot_b) if not is_image_source(s.source)))
    key = (place, view.camera, view.block, renderer.pair_key())
    return reader.read((renderer, sources), key, lambda: _pixel_request(renderer, view, place, sources))


def _pixel_request(
    renderer: Renderer, view: ViewState, place: PatchPlace, sources: Sequence[str]
) -> ReadRequest[PixelContent]:
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
    return ReadRequest((renderer.visibility.words_in(block.pixels), *drawn), make)
