"""Which mips of which textures the visible pixels read: what has to be on the GPU."""

from collections.abc import Callable, Sequence

import numpy as np

from ntc.codec.latents import LatentLevel
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.gl.read_back import ReadBack
from viewer.gl.timer import PassTimer
from viewer.render.resources.layout import GROUP_SIDE, StorageBinding
from viewer.render.resources.pack_buffers import PackBuffers
from viewer.render.resources.visibility_buffer import PlaneReading, VisibilityInputs

NOT_VISIBLE = 127
STAND_IN_SIDE = 64
"""Largest side in texels of the mip that stands in for finer ones while it is not known which are needed."""


class NeededLevelsPass:
    """Inputs: visibility buffer, materials, a pack's tables. Output, read back: the finest mip that is visible, by texture."""

    def __init__(
        self, context: GraphicsContext, programs: ProgramFactory, textures: int, reading: PlaneReading
    ) -> None:
        self._gl = context.gl
        self._program = programs.compute("passes/needed_levels/needed_levels.comp", reading.defines())
        what, none = "finest mips in sight", np.full(max(1, textures), NOT_VISIBLE, np.int32).tobytes()
        with context.memory.transaction():
            self._none = context.memory.buffer(what, none)
            self._levels = context.memory.buffer(what, none)
        self._back = ReadBack[VisibilityInputs](context, what)

    @property
    def bytes_on_gpu(self) -> int:
        """Size of the buffers."""
        return self._levels.size + self._none.size

    def run(self, inputs: VisibilityInputs, buffers: PackBuffers) -> None:
        """Find the finest mips of this view; `answer` tells them."""
        inputs.bind()
        buffers.bind_records()
        self._gl.copy_buffer(self._levels, self._none)
        self._levels.bind_to_storage_buffer(int(StorageBinding.RESULTS))
        self._program.run(*(-(-side // GROUP_SIDE) for side in inputs.visibility.size))
        self._gl.memory_barrier()
        self._back.copy([(self._levels, self._levels.size)], inputs)

    @property
    def is_pending(self) -> bool:
        """Whether the levels of a view are under way."""
        return self._back.is_pending

    def answer(self, waits: bool) -> tuple[dict[int, int], VisibilityInputs] | None:
        """Finest mip by texture id, without textures that are not visible, and the view that it is of: the newest that has arrived.

        None where nothing has. With `waits` that of the last view.
        """
        found = self._back.wait() if waits else self._back.newest()
        if found is None:
            return None
        levels = np.frombuffer(found[0], np.int32)
        return {int(index): int(levels[index]) for index in np.nonzero(levels < NOT_VISIBLE)[0]}, found[1]

    def release(self) -> None:
        """Free the buffers."""
        for part in (self._levels, self._none, self._back):
            part.release()


class VisibleLatents:
    """Keeps the mips on the GPU that the visible pixels read of one plane of a pack's maps.

    Where frames do not wait, they are there a frame or two after the pixels: coarser mips are shown until then.
    """

    def __init__(
        self, needed_levels: Callable[[], NeededLevelsPass] | None, buffers: PackBuffers, timer: PassTimer, waits: bool
    ) -> None:
        """`needed_levels` makes the pass, once it is needed; None: all mips of what may be visible are uploaded."""
        self._make_pass, self._buffers, self._timer, self._waits = needed_levels, buffers, timer, waits
        self._pass: NeededLevelsPass | None = None
        self._shown: VisibilityInputs | None = None
        self._known: VisibilityInputs | None = None
        """The last view whose mips are there."""
        store = buffers.latent_store
        self._coarse = np.array([_first_small(pyramid) for pyramid in store.pyramids], np.int64)
        """[textures] mip that stands in for finer ones."""
        self.version = 0
        """Changes when mips have arrived that a picture drawn before lacks."""

    @property
    def bytes_on_gpu(self) -> int:
        """Buffers of the pass."""
        return 0 if self._pass is None else self._pass.bytes_on_gpu

    @property
    def is_waiting(self) -> bool:
        """Whether it is not known yet what the last view needs."""
        return self._shown != self._known

    def upload(self, inputs: VisibilityInputs, whole: bool) -> None:
        """Upload what this view needs, as far as is known; with `whole` all of it. Raises GpuMemoryError."""
        store, decoders = self._buffers.latent_store, self._buffers.decoder_of_texture
        textures = [texture for texture in inputs.textures if decoders[texture] >= 0]
        if self._make_pass is None:
            self._upload_all(inputs)
        elif store.has(dict.fromkeys(textures, 0)):
            self._shown = self._known = inputs
        elif self._waits or whole:
            if self._known != inputs:
                self._ask(inputs)
                self._take(waits=True)
            self._shown = inputs
        else:
            self._buffers.need({index: int(min(store.finest[index], self._coarse[index])) for index in textures})
            self.poll(inputs)

    def poll(self, inputs: VisibilityInputs) -> None:
        """Upload what has been found out, and find out about this view. Never waits. Raises GpuMemoryError."""
        if self._make_pass is None:
            # A picture that is shown without having been drawn from these latents is of a pack before.
            is_first = self._shown is None
            self.version += self._upload_all(inputs) or is_first
            return
        self._shown = inputs
        self._take(waits=False)
        if self.is_waiting and not (self._pass is not None and self._pass.is_pending):
            self._ask(inputs)

    def _upload_all(self, inputs: VisibilityInputs) -> bool:
        """All mips of what may be visible; whether some were missing."""
        decoders = self._buffers.decoder_of_texture
        self._shown = self._known = inputs
        return self._buffers.need({texture: 0 for texture in inputs.textures if decoders[texture] >= 0})

    def _ask(self, inputs: VisibilityInputs) -> None:
        assert self._make_pass is not None
        self._pass = self._pass or self._make_pass()
        with self._timer.owned_by(None), self._timer.measure("latents"):
            self._pass.run(inputs, self._buffers)

    def _take(self, waits: bool) -> None:
        answer = None if self._pass is None else self._pass.answer(waits)
        if answer is None:
            return
        levels, self._known = answer
        is_new = self._buffers.need(levels)
        # A frame that waits has them before it draws.
        self.version += is_new and not self._waits

    def release(self) -> None:
        """Free the pass."""
        if self._pass is not None:
            self._pass.release()
        self._pass = self._shown = self._known = None


def _first_small(pyramid: Sequence[LatentLevel]) -> int:
    """The finest level of at most STAND_IN_SIDE texels a side, else the coarsest; 0 for none."""
    sides = [max(level.texel_width, level.texel_height) for level in pyramid]
    return next((number for number, side in enumerate(sides) if side <= STAND_IN_SIDE), max(0, len(sides) - 1))
