"""What a comparison of A and B has found, on the GPU: the FLIP map, and the error of each texture and decoder."""

from collections.abc import Sequence
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
    """Root mean square errors between A and B, in steps of 8-bit sRGB; NaN for textures that are not seen."""

    by_texture: NDArray[np.float32]
    """[textures]."""
    by_decoder: NDArray[np.float32]
    """[textures]: of all textures of the texture's decoder."""


class ErrorOverlay:
    """Textures and buffers are made when they are shown, and once."""

    def __init__(self, context: GraphicsContext, textures: int) -> None:
        self._context, self._textures = context, textures
        self._errors: ComparisonErrors | None = None
        self._marks: TextureMarks | None = None
        self._marks_key: object = None
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

    def marks(self, overlay: Overlay, lit: Sequence[int], visibility: VisibilityTarget) -> MarksOverlay | None:
        """What to do to the textures of the picture; None where there is nothing to do."""
        shares = self._shares(overlay)
        if shares is None and not lit:
            return None
        key = (overlay.kind if shares is not None else None, self._errors if shares is not None else None, tuple(lit))
        if self._marks is None or key != self._marks_key:
            made = TextureMarks(self._context, shares, lit, self._textures)
            if self._marks is not None:
                self._marks.release()
            self._marks, self._marks_key = made, key
        return MarksOverlay(self._marks, visibility, overlay.opacity, overlay.palette)

    def marks_key(self, overlay: Overlay, lit: Sequence[int]) -> object:
        """Equal keys mean equal marks."""
        shown = overlay.kind in ("error-texture", "error-decoder")
        return (overlay, self._errors, tuple(lit)) if shown else tuple(lit)

    def _shares(self, overlay: Overlay) -> NDArray[np.float32] | None:
        if self._errors is None or overlay.kind not in ("error-texture", "error-decoder"):
            return None
        values = self._errors.by_texture if overlay.kind == "error-texture" else self._errors.by_decoder
        return values / np.float32(largest_error(values))

    def release(self) -> None:
        """Free everything on the GPU."""
        if self._marks is not None:
            self._marks.release()
        self.set_flip(None, None)
        self._marks = self._marks_key = None


def largest_error(values: NDArray[np.float32]) -> float:
    """What stands at the far end of the palette."""
    known = values[np.isfinite(values)]
    return max(float(known.max()), LEAST_ERROR) if known.size else LEAST_ERROR
