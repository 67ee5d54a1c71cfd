"""Results of the comparison of A and B, on the GPU: the FLIP map, and the error of each texture and decoder."""

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext
from viewer.render.passes.composite import MarksOverlay
from viewer.render.resources.texture_marks import TextureMarks
from viewer.render.resources.visibility_buffer import VisibilityTarget
from viewer.state.view_state import Overlay

LEAST_ERROR = 1e-6
"""Steps of 8-bit sRGB: where nothing differs more, nothing is divided by less."""


@dataclass(frozen=True, eq=False)
class ComparisonErrors:
    """Root mean square errors between A and B, in steps of 8-bit sRGB; NaN for textures that are not visible."""

    by_texture: NDArray[np.float32]
    """[textures]."""
    by_decoder: NDArray[np.float32]
    """[textures]: of all textures of the texture's decoder."""


@dataclass(frozen=True)
class MarksInputs:
    """What the marks are made from."""

    errors: ComparisonErrors | None
    """None where the overlay shows none."""
    by_decoder: bool
    highlighted: tuple[int, ...]


class ErrorOverlay:
    """Textures and buffers are made when they are shown, and once."""

    def __init__(self, context: GraphicsContext, textures: int) -> None:
        self._context, self._textures = context, textures
        self._errors: ComparisonErrors | None = None
        self._marks: TextureMarks | None = None
        self._marks_inputs: MarksInputs | None = None
        self._flip: moderngl.Texture | None = None
        self._flip_key: object = None

    def set_errors(self, errors: ComparisonErrors | None) -> None:
        """Show these from now on; None where there are none."""
        self._errors = errors

    def set_flip(self, flip: NDArray[np.float32] | None, key: object) -> None:
        """The FLIP map [H, W], row 0 on top, of the picture that `key` stands for; None: it is not known."""
        if self._flip is not None:
            self._flip.release()
            self._flip = None
        if flip is not None:
            self._flip = self._context.memory.texture(
                "the FLIP map", (flip.shape[1], flip.shape[0]), 1, flip[::-1].astype("<f4").tobytes(), dtype="f4"
            )
            self._flip.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._flip_key = key

    def flip_map(self, key: object) -> moderngl.Texture | None:
        """The map, if it is of the picture that `key` stands for."""
        return self._flip if key == self._flip_key else None

    def marks(
        self, overlay: Overlay, highlighted: tuple[int, ...], visibility: VisibilityTarget
    ) -> MarksOverlay | None:
        """How to colour or dim the textures of the picture; None where nothing is."""
        errors = self._errors if overlay.kind in ("error-texture", "error-decoder") else None
        if errors is None and not highlighted:
            return None
        inputs = MarksInputs(errors, errors is not None and overlay.kind == "error-decoder", highlighted)
        if self._marks is None or inputs != self._marks_inputs:
            shares = None
            if errors is not None:
                values = errors.by_decoder if inputs.by_decoder else errors.by_texture
                shares = values / np.float32(largest_error(values))
            made = TextureMarks(self._context, shares, highlighted, self._textures)
            if self._marks is not None:
                self._marks.release()
            self._marks, self._marks_inputs = made, inputs
        return MarksOverlay(self._marks, visibility, overlay.opacity, overlay.palette)

    def release(self) -> None:
        """Free everything on the GPU."""
        if self._marks is not None:
            self._marks.release()
        self.set_flip(None, None)
        self._marks = self._marks_inputs = None


def largest_error(values: NDArray[np.float32]) -> float:
    """The error at the far end of the palette."""
    known = values[np.isfinite(values)]
    return max(float(known.max()), LEAST_ERROR) if known.size else LEAST_ERROR
