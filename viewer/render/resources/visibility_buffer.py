"""Visibility buffer: the surface of each pixel, as integer words and depth (docs/explanation/decode-paths.md)."""

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import CODED_PLANES, Plane
from viewer.gl import functions as names
from viewer.gl.allocation import GpuMemory
from viewer.gl.context import GraphicsContext
from viewer.gl.read_back import PicturePart
from viewer.render.resources.layout import TextureUnit, materials_of, texture_ids_of
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.scene.model import Camera
from viewer.state.view_state import DEFAULT_LIGHTING, Lighting, MaterialView


@dataclass(frozen=True)
class SurfaceContent:
    """Optional content of a visibility buffer, besides ids, uv and footprint."""

    colors: bool
    """True if the buffer holds vertex colours."""
    gradients: bool
    """True if the buffer holds derivatives of uv, for anisotropic filtering."""
    frame: bool = False
    """True if the buffer holds the surface's normal and tangent, for light."""
    second_uvs: bool = False
    """True if the buffer holds uv and footprint of a second UV set."""

    def units(self) -> tuple[TextureUnit, ...]:
        """Return the texture units of the optional content, in the order of the attachments from 1 on."""
        return tuple(unit for unit, (name, _, _) in CONTENT.items() if getattr(self, name))

    def defines(self) -> dict[str, int]:
        """Return the defines of shaders that write or read the buffer."""
        flags = {"VERTEX_COLORS": int(self.colors)}
        flags |= {name.upper(): int(getattr(self, name)) for name in ("gradients", "frame", "second_uvs")}
        return flags | {f"OUTPUT_{unit.name}": place for place, unit in enumerate(self.units(), start=1)}


CONTENT: dict[TextureUnit, tuple[str, int, Literal["u4", "f4"]]] = {
    TextureUnit.SURFACE_COLOR: ("colors", 1, "u4"),
    TextureUnit.SURFACE_GRADIENTS: ("gradients", 4, "f4"),
    TextureUnit.SURFACE_FRAME: ("frame", 2, "u4"),
    TextureUnit.SURFACE_SECOND_UVS: ("second_uvs", 4, "f4"),
}
"""Optional textures: field of SurfaceContent, number of components, and their type."""


@dataclass(frozen=True)
class PlaneReading:
    """Settings of a pass that reads surfaces, for one plane of maps or several."""

    plane: Plane = "base"
    colors: bool = False
    """True if the visibility buffer holds vertex colours."""
    second_uvs: bool = False
    """True if the visibility buffer holds a second UV set; plane `base` does not read it."""
    has_several: bool = False
    """True for a pass of several planes; `plane` has no effect then."""

    def defines(self) -> dict[str, int]:
        """Return the defines of shaders that read surfaces."""
        second_uvs = self.second_uvs and (self.has_several or self.plane != "base")
        plane = {} if self.has_several else {"PLANE": CODED_PLANES.index(self.plane)}
        return {"VERTEX_COLORS": int(self.colors), "SECOND_UVS": int(second_uvs), **plane}


class VisibilityTarget:
    """Visibility buffer of one picture size (width, height): integer words and depth, and what `content` adds."""

    def __init__(self, context: GraphicsContext, size: tuple[int, int], content: SurfaceContent) -> None:
        self._functions = context.functions
        self.size = size
        self.content = content
        with context.memory.transaction():
            self._make_textures(context.memory)
        # A software renderer maps new memory at its first use, which should not be timed with a pass.
        self.clear()

    def _make_textures(self, memory: GpuMemory) -> None:
        what, size = f"visibility buffer {self.size[0]}x{self.size[1]}", self.size
        self._words = memory.texture(what, size, 4, dtype="u4")
        self._textures = {TextureUnit.SURFACE: self._words}
        for unit in self.content.units():
            _, components, kind = CONTENT[unit]
            self._textures[unit] = memory.texture(what, size, components, dtype=kind)
        for texture in self._textures.values():
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.depth = memory.depth_texture(what, size)
        self.framebuffer = memory.framebuffer(what, list(self._textures.values()), self.depth)

    def clear(self) -> None:
        """Set all pixels to background: ids 0, farthest depth. Nothing reads the other words of such a pixel."""
        self.framebuffer.use()
        self.framebuffer.clear(depth=1.0)
        # glClear is undefined for integer targets.
        zero = (ctypes.c_uint * 4)()
        self._functions("glClearBufferuiv", names.GL_COLOR, 0, ctypes.addressof(zero))

    def write(self, words: NDArray[np.uint32]) -> None:
        """Replace the words by `words` [H, W, 4] uint32, row 0 at the bottom: for benchmarks and tests."""
        self._words.write(np.ascontiguousarray(words, np.uint32).tobytes())

    def bind(self) -> None:
        """Bind for reading by `common/visibility.glsl`."""
        for unit, texture in self._textures.items():
            texture.use(int(unit))

    def words(self) -> NDArray[np.uint32]:
        """Return ids, uv and footprint of each pixel: [H, W, 4] uint32, row 0 on top (docs/explanation/decode-paths.md)."""
        return np.frombuffer(self._words.read(), np.uint32).reshape(self.size[1], self.size[0], 4)[::-1]

    def colors(self) -> NDArray[np.float64] | None:
        """Return linear vertex colours: [H, W, 3], row 0 on top; None if the buffer has none."""
        if not self.content.colors:
            return None
        words = np.frombuffer(self._textures[TextureUnit.SURFACE_COLOR].read(), np.uint32)
        bits = words.reshape(self.size[1], self.size[0])[::-1]
        roots = np.stack([(bits >> np.uint32(shift)) & np.uint32(1023) for shift in (0, 10, 20)], axis=-1)
        return (roots / 1023.0) ** 2

    def frames(self) -> NDArray[np.uint32]:
        """Return packed normal and tangent (shaders/common/frame.glsl): [H, W, 2] uint32, row 0 on top. Raises KeyError if absent."""
        words = np.frombuffer(self._textures[TextureUnit.SURFACE_FRAME].read(), np.uint32)
        return words.reshape(self.size[1], self.size[0], 2)[::-1]

    def read_id_bytes(self) -> bytes:
        """Return the first word of every pixel, uint32, row 0 at the bottom, for `texture_ids_of` and `materials_of`."""
        return bytes(self.framebuffer.read(components=1, attachment=0, alignment=1, dtype="u4"))

    def words_in(self, pixels: tuple[int, int, int, int]) -> PicturePart:
        """Return the words of a rectangle; `pixels`: left, top, right, bottom from the upper left corner."""
        return PicturePart(self.framebuffer, pixels, "u4")

    def texture_ids(self) -> NDArray[np.int32]:
        """Return the texture id of each pixel: [H, W] int32, row 0 on top, -1 for none."""
        return texture_ids_of(self.words()[..., 0])

    def materials(self) -> NDArray[np.int32]:
        """Return the material of each pixel: [H, W] int32, row 0 on top, -1 for the background."""
        return materials_of(self.words()[..., 0])

    def release(self) -> None:
        """Free the textures."""
        self.framebuffer.release()
        self.depth.release()
        for texture in self._textures.values():
            texture.release()


@dataclass(frozen=True)
class VisibilityInputs:
    """Inputs of passes that colour the pixels of a view. Equal inputs show the same surfaces with the same filter."""

    visibility: VisibilityTarget
    """Visibility buffer of the view, with gradients where `anisotropy` is above 1."""
    materials: SceneBuffers = field(compare=False)
    camera: Camera | None = None
    """Camera of the view; None for a visibility buffer that no camera drew."""
    version: int = 0
    """Version that changes whenever the content of the visibility buffer may change."""
    anisotropy: int = 1
    """Anisotropic filtering of the reference and of path `cached`: 1 (trilinear) to 16."""
    plane: Plane = "base"
    """Plane of maps to draw."""
    sample: int = 0
    """Number of the stochastic filter's sample; without effect for other filters."""
    blend_sample: int = 0
    """Number of the pattern of thresholds that BLEND surfaces were drawn against."""
    textures: tuple[int, ...] = field(default=(), compare=False)
    """Ids of the textures that may be visible in this plane, ascending."""
    plane_textures: Mapping[Plane, tuple[int, ...]] = field(default_factory=dict, compare=False)
    """Ids of the textures that may be visible, ascending, by plane."""
    visible_materials: tuple[int, ...] = field(default=(), compare=False)
    """Materials that may be visible, ascending."""
    matrix: NDArray[np.float64] = field(default_factory=lambda: np.eye(4), compare=False)
    """[4, 4] float64, world to clip."""

    def of_plane(self, plane: Plane) -> "VisibilityInputs":
        """Return these inputs for another plane of the maps."""
        return self if plane == self.plane else replace(self, plane=plane, textures=self.plane_textures[plane])

    def of_sample(self, number: int) -> "VisibilityInputs":
        """Return these inputs for another sample of the stochastic filter."""
        return replace(self, sample=number)

    def bind(self) -> None:
        """Bind visibility buffer and materials for reading."""
        self.visibility.bind()
        self.materials.bind_materials()


@dataclass(frozen=True)
class ShownMaterials:
    """Maps and light of materials that a picture shows."""

    view: MaterialView = "base"
    lighting: Lighting = DEFAULT_LIGHTING
    """Light of the view `lit`; without effect in others."""
    planes: tuple[Plane, ...] = ("base",)
    """Planes of the view that some visible material has; other planes are neutral."""
