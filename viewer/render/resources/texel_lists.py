"""Lists of texels that something besides GLSL decodes: what a back end has to offer, and how its texels become pixels or tiles."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import moderngl
import numpy as np

from ntc.codec.maps import Plane
from ntc.codec.model import Pack
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.resources.layout import TEXEL_GROUP, StorageBinding
from viewer.state.view_state import Precision

TEXEL_RECORD = np.dtype([("u", "<u4"), ("v", "<u4"), ("lod", "<f4"), ("texture_wrap", "<i4")])
"""One texel of a list, a uvec4 to shaders: wrapped coordinates in units of 2^-32; `texture_wrap` as in REQUEST_RECORD, or -1 where
nothing is to be decoded."""
LIST_TEXELS = 1 << 18
"""Texels listed and decoded together: 4 MiB each way."""
VALUE_BYTES = 16


class SharedBuffer(Protocol):
    """A buffer of OpenGL in rows of 16 bytes, as a back end sees it."""

    def read(self, rows: int) -> Any:
        """The first `rows` rows in the back end's own kind of array [rows, 4], 32-bit words."""

    def write(self, values: Any) -> None:
        """Replace the first rows by an array [rows, 4] of float32."""

    def release(self) -> None:
        """Give it back, before the buffer itself is freed."""


class ListDecoder(Protocol):
    """Decodes lists of texels of one pack. All calls belong to the thread of the OpenGL context."""

    def share(self, buffer: moderngl.Buffer) -> SharedBuffer:
        """`buffer` for reading and writing."""

    def decode(self, texels: SharedBuffer, values: SharedBuffer, count: int, plane: Plane) -> None:
        """Decode the first `count` TEXEL_RECORDs of `texels` into `values`: the plane's four components in [0, 1].

        They are in the texture's colour space, and 0 where a texture lacks one or none is asked for.
        """

    def replace(self, pack: Pack) -> None:
        """Decode another version of the pack from now on."""


MakeListDecoder = Callable[[Pack, Sequence[int], Precision], ListDecoder]
"""(pack, its texture by slot of the scene's table or -1, precision) -> what decodes it. Raises InputError."""


class TexelLists:
    """Fills lists by one shader, has them decoded, and puts the texels where they belong by another one."""

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        folder: str,
        defines: Mapping[str, int | float | str],
        decoder: ListDecoder,
        plane: Plane,
    ) -> None:
        """`folder` holds the shaders, `list.comp` and `show.comp`. Raises GpuMemoryError."""
        self._gl, self._decoder, self._plane = context.gl, decoder, plane
        self._list, self._show = (programs.compute(f"{folder}/{name}.comp", defines) for name in ("list", "show"))
        with context.memory.transaction():
            self.buffers = tuple(
                context.memory.buffer("lists of texels", reserve=LIST_TEXELS * size)
                for size in (TEXEL_RECORD.itemsize, VALUE_BYTES)
            )
        self._texels, self._values = map(decoder.share, self.buffers)

    def run(self, count: int, uniforms: dict[str, int] | None = None) -> None:
        """List, decode and show texels 0 to `count` - 1, whatever those are to the shaders; what else they read is bound.

        `uniforms` are those of `list.comp`.
        """
        set_uniforms(self._list, uniforms or {})
        texels, values = self.buffers
        for first in range(0, count, LIST_TEXELS):
            number = min(LIST_TEXELS, count - first)
            part = {"first_texel": first, "texel_count": number}
            texels.bind_to_storage_buffer(int(StorageBinding.RESULTS))
            set_uniforms(self._list, part)
            self._list.run(-(-number // TEXEL_GROUP))
            self._gl.memory_barrier()
            self._decoder.decode(self._texels, self._values, number, self._plane)
            values.bind_to_storage_buffer(int(StorageBinding.RESULTS))
            set_uniforms(self._show, part)
            self._show.run(-(-number // TEXEL_GROUP))
            self._gl.memory_barrier()

    def release(self) -> None:
        """Free the lists."""
        for shared, buffer in zip((self._texels, self._values), self.buffers, strict=True):
            shared.release()
            buffer.release()
