"""Divergence maps of one picture under several groupings, and the texture -> decoder tables for counting."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.metrics.divergence import DivergenceStatistics
from viewer.gl.context import GraphicsContext
from viewer.gl.read_back import ReadBack
from viewer.render.resources.layout import StorageBinding

T = TypeVar("T")
Stage = Literal["compute", "fragment"]
"""Kind of shader that counts. `fragment` is for drivers with slow or no compute shaders."""


@dataclass(frozen=True)
class CountedGrouping:
    """Grouping to count decoders of."""

    version: int
    """Version that changes with the decoders, and only with them."""
    decoders: tuple[int, ...] = field(compare=False)
    """Decoder of each texture of the scene, -1 where nothing is decoded."""


class DivergenceTarget:
    """Divergence maps of a picture of `picture` (width, height) pixels under several groupings, and their statistics.

    `block` is (width, height) in pixels. Row 0 of a map is at the top.
    """

    def __init__(
        self, context: GraphicsContext, picture: tuple[int, int], block: tuple[int, int], groupings: int = 1
    ) -> None:
        self.picture, self.block, self.groupings = picture, block, groupings
        self.size = (-(-picture[0] // block[0]), -(-picture[1] // block[1]))
        """(columns, rows) of blocks of one map."""
        self._counts = block[0] * block[1] + 1
        what, memory = "divergence maps", context.memory
        with memory.transaction():
            self.texture = memory.texture(what, (self.size[0], self.size[1] * groupings), 1, dtype="u4")
            self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self.framebuffer = memory.framebuffer(what, [self.texture])
            self.histogram = memory.buffer(what, reserve=4 * self._counts * groupings)
        self.counted_by: Stage = "compute"
        """Stage that wrote the maps; only `compute` fills the histogram."""

    def read(self, grouping: int = 0) -> NDArray[np.uint16]:
        """Return one map, as `ntc.metrics.divergence.divergence_map`: [ceil(H / block height), ceil(W / block width)] uint16."""
        return np.asarray(self._maps(self.texture.read(alignment=1))[grouping], np.uint16)

    def _maps(self, content: bytes) -> NDArray[np.uint16]:
        columns, rows = self.size
        words = np.frombuffer(content, np.uint32).reshape(self.groupings, rows, columns)
        return np.asarray(words, np.uint16)

    def copy_counts(self, back: ReadBack[T], tag: T) -> None:
        """Copy the data for `statistics_in` to `back`: the histograms, or the maps if a fragment shader counted."""
        if self.counted_by == "fragment":
            back.copy_texture(self.texture, 4 * self.size[0] * self.size[1] * self.groupings, tag)
        else:
            back.copy([(self.histogram, self.histogram.size)], tag)

    def statistics_in(self, content: bytes) -> tuple[DivergenceStatistics, ...]:
        """Return the statistics of each map from the data of `copy_counts`."""
        if self.counted_by == "fragment":
            return tuple(DivergenceStatistics.of(counted) for counted in self._maps(content))
        counts = np.frombuffer(content, np.uint32).reshape(self.groupings, self._counts)
        return tuple(DivergenceStatistics(tuple(row.tolist())) for row in counts)

    def statistics(self, grouping: int = 0) -> DivergenceStatistics:
        """Return the statistics of one map, read back now."""
        read = self.texture.read(alignment=1) if self.counted_by == "fragment" else self.histogram.read()
        return self.statistics_in(read)[grouping]

    def release(self) -> None:
        """Free texture and buffer."""
        self.framebuffer.release()
        self.texture.release()
        self.histogram.release()


class DecoderTables:
    """Decoder of every texture of a scene under each of several groupings; -1 where nothing is decoded."""

    def __init__(self, context: GraphicsContext, groupings: Sequence[Sequence[int]]) -> None:
        # An empty buffer cannot be bound, so there is one more entry than textures.
        self.textures = len(groupings[0]) + 1
        numbers = np.array([[*decoders, -1] for decoders in groupings], "<i4")
        self._context = context
        self._buffer = context.memory.buffer("decoders of the textures", numbers.tobytes())

    def bind(self) -> None:
        """Bind to its storage binding."""
        self._context.bind_storage(self._buffer, int(StorageBinding.DECODERS))

    def release(self) -> None:
        """Free the buffer."""
        self._buffer.release()
