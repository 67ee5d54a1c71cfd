"""Composite pass: slots A and B, or their difference, with overlays, as the final 8-bit sRGB picture."""

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.pass_scheduler import RenderPass
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.divergence_maps import DivergenceTarget
from viewer.render.resources.layout import PALETTE_STEPS, StorageBinding, TextureUnit
from viewer.render.resources.visibility_buffer import VisibilityTarget
from viewer.state.compare_layout import CompareLayout
from viewer.state.palettes import PaletteName, palette_colors
from viewer.state.view_state import WHOLE, CompareMode, Difference, DifferenceKind, Zoom

DIMMED = 0.18
"""Brightness factor of textures that are not highlighted."""
NO_COLOR = -1.0


class TextureMarks:
    """Buffer of two numbers for each texture: position on the palette (-1: no colour), and brightness, 0 to 1.

    Entry 0 is for surfaces without a texture.
    """

    def __init__(
        self, context: GraphicsContext, shares: NDArray[np.float32] | None, lit: Sequence[int], textures: int
    ) -> None:
        """Take palette positions `shares` [textures] (NaN: no colour; None: none at all), and the ids of highlighted textures."""
        marks = np.empty((textures + 1, 2), "<f4")
        marks[:, 0] = NO_COLOR
        if shares is not None:
            marks[1:, 0] = np.where(np.isfinite(shares), np.clip(shares, 0.0, 1.0), NO_COLOR)
        marks[:, 1] = DIMMED if lit else 1.0
        marks[[texture + 1 for texture in lit], 1] = 1.0
        self._context = context
        self._buffer = context.memory.buffer("marks of the textures", marks.tobytes())

    def bind(self) -> None:
        """Bind to the storage binding of decoder tables. No pass reads both."""
        self._context.bind_storage(self._buffer, int(StorageBinding.DECODERS))

    def release(self) -> None:
        """Free the buffer."""
        self._buffer.release()


LEAST_LIGHT = 0.01
"""Smallest divisor of a relative difference, in linear light."""
SCRATCH = (8, 8)
"""Width and height in pixels of the picture that `prepare` draws to compile a program."""
COMPARISONS: tuple[tuple[CompareMode, DifferenceKind], ...] = (
    ("a", "raw"),
    ("b", "raw"),
    ("wipe", "raw"),
    ("difference", "raw"),
    ("difference", "relative"),
    ("difference", "flip"),
)
"""Comparison modes, one for each program of the composite."""
FLIP_PALETTE: PaletteName = "viridis"


class CompositeTarget:
    """RGBA8 target of one picture size (width, height): sRGB-coded numbers in a linear format, row 0 at the bottom."""

    def __init__(self, context: GraphicsContext, size: tuple[int, int]) -> None:
        self.size = size
        what = f"a picture of {size[0]} x {size[1]}"
        with context.memory.transaction():
            self.texture = context.memory.texture(what, size, 4)
            self.framebuffer = context.memory.framebuffer(what, [self.texture])
        # A software renderer maps fresh memory at its first use: here, not in the first timed pass.
        self.framebuffer.clear()

    def release(self) -> None:
        """Free the texture."""
        self.framebuffer.release()
        self.texture.release()


@dataclass(frozen=True)
class HeatmapOverlay:
    """Heat map of the decoders per block, over the picture."""

    maps: DivergenceTarget
    first: int
    """Index of the map for a single slot, or for the slot left of the divider."""
    second: int
    """Index of the map for the slot right of the divider."""
    most: int
    """Number of decoders at the far end of the palette."""
    opacity: float
    palette: PaletteName

    def uniforms(self) -> dict[str, object]:
        """Return the values of the shader's uniforms."""
        rows = self.maps.size[1]
        return {
            "picture": self.maps.picture,
            "block": self.maps.block,
            "first_rows": (self.first * rows, self.second * rows),
            "most": float(self.most),
            "opacity": self.opacity,
            "palette": palette_steps(self.palette),
        }


@dataclass(frozen=True)
class MarksOverlay:
    """Colours or dimming of whole textures, over the picture."""

    marks: TextureMarks
    visibility: VisibilityTarget
    opacity: float
    palette: PaletteName


@dataclass(frozen=True)
class DifferenceParams:
    """Difference of A and B in place of a slot."""

    difference: Difference
    flip_map: moderngl.Texture | None = None
    """FLIP map for kind `flip`: R32F of the picture's size, row 0 at the bottom; None until it is computed."""

    @property
    def variant(self) -> int:
        """Value of DIFFERENCE in the shader."""
        return {"raw": 1, "amplified": 1, "relative": 2, "flip": 3}[self.difference.kind]

    def uniforms(self) -> dict[str, object]:
        """Return the values of the shader's uniforms."""
        values: dict[str, object] = {
            "gain": self.difference.gain if self.difference.kind == "amplified" else 1.0,
            "least": LEAST_LIGHT,
            "flip_is_known": self.flip_map is not None,
        }
        return values | ({"flip_palette": palette_steps(FLIP_PALETTE)} if self.variant == 3 else {})


@dataclass(frozen=True)
class CompositeParams:
    """Settings of the composite. Without `layout` and `difference`, only the first slot is shown."""

    layout: CompareLayout | None = None
    difference: DifferenceParams | None = None
    overlay: HeatmapOverlay | None = None
    marks: MarksOverlay | None = None
    zoom: Zoom = WHOLE

    @property
    def defines(self) -> dict[str, int]:
        """Defines of the shader that draws the composite."""
        return {
            "SPLIT": int(self.layout is not None),
            "DIFFERENCE": self.difference.variant if self.difference is not None else 0,
            "OVERLAY": int(self.overlay is not None),
            "MARKS": int(self.marks is not None),
            "ZOOM": int(not self.zoom.is_whole),
        }


CompositeVariant = tuple[tuple[tuple[str, int], ...], tuple[str, str]]
"""Key of a compiled program: its defines, and both pictures' texel types, because drivers may compile for each."""


@dataclass(frozen=True)
class CompositeInputs:
    """Inputs of the composite. Equal inputs of the same content give equal pictures."""

    first: ColorTarget
    second: ColorTarget
    """Picture of the second slot; equals `first`, and is not read, if one slot fills the picture."""
    params: CompositeParams

    @property
    def variant(self) -> CompositeVariant:
        """Program that draws the composite."""
        return tuple(self.params.defines.items()), (self.first.texture.dtype, self.second.texture.dtype)


def palette_steps(name: PaletteName) -> bytes:
    """Return a palette as the shader reads it."""
    return palette_colors(name, np.linspace(0.0, 1.0, PALETTE_STEPS)).astype("<f4").tobytes()


def _layout_uniforms(layout: CompareLayout, size: tuple[int, int]) -> dict[str, object]:
    width, height = size
    # Rows of the shader count from below.
    line = (1.0, 0.0, layout.position * width) if layout.vertical else (0.0, -1.0, (layout.position - 1.0) * height)
    return {"line": line, "shift": layout.shift * width}


class CompositePass(RenderPass[CompositeInputs, CompositeTarget]):
    """Pass that composes the picture. Output: an 8-bit sRGB picture."""

    name = "composite"

    def __init__(self, context: GraphicsContext, programs: ProgramFactory) -> None:
        self._gl = context.gl
        self._programs = programs
        self._drawn: set[CompositeVariant] = set()
        self._scratch = CompositeTarget(context, SCRATCH)

    def prepare(self, inputs: CompositeInputs) -> bool:
        """Compile the program for `inputs` by drawing a few pixels; return False if it is compiled already."""
        if inputs.variant in self._drawn:
            return False
        self.run(inputs, self._scratch)
        return True

    def run(self, inputs: CompositeInputs, output: CompositeTarget) -> None:
        """Draw the picture."""
        params, size = inputs.params, inputs.first.size
        self._drawn.add(inputs.variant)
        triangle = self._programs.fullscreen("passes/composite/composite.frag", params.defines)
        output.framebuffer.use()
        self._gl.enable_only(moderngl.NOTHING)
        values: dict[str, object] = {"depth": 0.0}
        inputs.first.texture.use(int(TextureUnit.PICTURE_A))
        if params.layout is not None or params.difference is not None:
            inputs.second.texture.use(int(TextureUnit.PICTURE_B))
        if params.layout is not None:
            values |= _layout_uniforms(params.layout, size)
        if params.difference is not None:
            values |= params.difference.uniforms()
            if params.difference.flip_map is not None:
                params.difference.flip_map.use(int(TextureUnit.FLIP))
        if not params.zoom.is_whole:
            left, top = params.zoom.corner
            values["zoom"] = params.zoom.factor
            values["corner"] = (left * size[0], (1.0 - top - 1.0 / params.zoom.factor) * size[1])
        if params.marks is not None:
            params.marks.visibility.bind()
            params.marks.marks.bind()
            values |= {"opacity": params.marks.opacity, "palette": palette_steps(params.marks.palette)}
        if params.overlay is not None:
            params.overlay.maps.texture.use(int(TextureUnit.DIVERGENCE))
            values |= params.overlay.uniforms()
        set_uniforms(triangle.program, values)
        triangle.render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free the scratch picture."""
        self._scratch.release()
