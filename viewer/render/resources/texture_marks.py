"""What the composite does to the pixels of each texture: a colour over them, or less light."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext
from viewer.render.resources.layout import StorageBinding

DIMMED = 0.18
"""Light of what is not highlighted."""
NO_COLOR = -1.0


class TextureMarks:
    """Two numbers for each texture and, first, for what has none: place on the palette (-1: no colour), and light, 0 to 1."""

    def __init__(
        self, context: GraphicsContext, shares: NDArray[np.float32] | None, lit: Sequence[int], textures: int
    ) -> None:
        """`shares` [textures], NaN for none, or None for no colours; `lit` ids of the textures that keep their light, or none."""
        marks = np.empty((textures + 1, 2), "<f4")
        marks[:, 0] = NO_COLOR
        if shares is not None:
            marks[1:, 0] = np.where(np.isfinite(shares), np.clip(shares, 0.0, 1.0), NO_COLOR)
        marks[:, 1] = DIMMED if lit else 1.0
        marks[[texture + 1 for texture in lit], 1] = 1.0
        self._context = context
        self._buffer = context.memory.buffer("marks of the textures", marks.tobytes())

    def bind(self) -> None:
        """Bind to its storage binding, which it shares with the decoder tables: every pass binds its own first."""
        self._context.bind_storage(self._buffer, int(StorageBinding.DECODERS))

    def release(self) -> None:
        """Free the buffer."""
        self._buffer.release()
