"""Draw commands that the GPU has written."""

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.indirect import IndirectDraws
from viewer.render.resources.clusters.records import BUCKET_RECORD
from viewer.render.resources.culling import Bucket

COUNT_OFFSET = int(BUCKET_RECORD.fields["commands"][1]) if BUCKET_RECORD.fields else 0
"""Bytes before the number of commands in a BUCKET_RECORD."""


@dataclass(frozen=True, eq=False)
class GpuDrawList:
    """What to draw for one camera and one size of its picture; in the same buffers as the list before."""

    ranges: tuple[tuple[Bucket, int, int], ...]
    """(bucket, first command, most commands)."""
    materials: NDArray[np.bool_]
    """[materials] whether an instance with the material may be seen."""
    commands: moderngl.Buffer
    """DrawElementsIndirectCommands."""
    buckets: moderngl.Buffer
    """BUCKET_RECORD of each of `ranges`."""
    draws: IndirectDraws

    def draw(self, array: moderngl.VertexArray, index_bytes: int, number: int) -> None:
        """Draw what is seen of range `number`."""
        _, first, most = self.ranges[number]
        place = BUCKET_RECORD.itemsize * number + COUNT_OFFSET
        self.draws.draw(array, index_bytes, self.commands, first, most, self.buckets, place)
