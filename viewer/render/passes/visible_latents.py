"""Upload of the mips that visible pixels read. A compute shader finds the finest visible mip of each texture."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.codec.latents import LatentLevel
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.gl.read_back import ReadBack
from viewer.render.pass_scheduler import Budget, Pending, Progress, RenderPass, Step
from viewer.render.resources.layout import GROUP_SIDE, StorageBinding
from viewer.render.resources.pack_buffers import PackBuffers
from viewer.render.resources.visibility_buffer import PlaneReading, VisibilityInputs

NOT_VISIBLE = 127
WHAT = "finest mips in sight"
"""Name of the buffers in error messages."""
FALLBACK_SIDE = 64
"""Largest side in texels of the mip that is uploaded while it is unknown which finer ones are needed."""


@dataclass(eq=False)
class VisibleLatents:
    """Mips of one plane of a pack that a view needs, as far as they are known."""

    needed: Mapping[int, int] | None = None
    """Finest visible mip by texture; None until the GPU has answered."""
    shown: NDArray[np.int32] | None = None
    """[textures of the view] finest mip on the GPU at the last change of the output."""


class VisibleLatentsPass(RenderPass[VisibilityInputs, VisibleLatents]):
    """Pass that uploads the mips of one plane of a pack that the visible pixels read.

    If frames do not wait, the GPU's answer arrives a frame or two later; coarser mips are shown until then.
    """

    name = "latents"

    def __init__(
        self, context: GraphicsContext, programs: ProgramFactory, buffers: PackBuffers, reading: PlaneReading
    ) -> None:
        """Take the plane of `reading`. Without compute shaders, all mips of textures that may be visible are uploaded."""
        self._context, self._programs, self._buffers, self._reading = context, programs, buffers, reading
        self._levels: tuple[moderngl.Buffer, moderngl.Buffer] | None = None
        """[textures] finest visible mip, and its initial value NOT_VISIBLE; allocated at the first request."""
        self._back = ReadBack[VisibilityInputs](context, WHAT)
        self._coarse = np.array([_first_small(pyramid) for pyramid in buffers.latent_store.pyramids], np.int64)
        """[textures] mip to show until the answer arrives."""

    @property
    def bytes_on_gpu(self) -> int:
        """Number of bytes of the pass's buffers."""
        return sum(buffer.size for buffer in self._levels or ())

    def advance(self, inputs: VisibilityInputs, target: VisibleLatents, step: Step) -> Progress:
        """Upload the mips that the view is known to need; if frames wait, all that it needs. Raises GpuMemoryError."""
        store, decoders = self._buffers.latent_store, self._buffers.decoder_of_texture
        textures = [texture for texture in inputs.textures if decoders[texture] >= 0]
        if not step.is_same_view:
            target.needed = target.shown = None
        all_of_them = dict.fromkeys(textures, 0)
        if not self._context.features.compute or store.has(all_of_them):
            target.needed = all_of_them
        elif step.budget.waits:
            self._ask(inputs)
            self._take(inputs, target, step.budget)
        else:
            self._buffers.ensure_resident(
                {index: int(min(store.finest[index], self._coarse[index])) for index in textures}
            )
            self._take(inputs, target, step.budget)
            if target.needed is None and not self._back.is_pending:
                self._ask(inputs)
        if target.needed is not None:
            self._buffers.ensure_resident(target.needed)
        left = len(textures) if target.needed is None else 0
        pending = (Pending("textures", left, len(textures)),) if left else ()
        return Progress(self._is_finer(textures, target), pending)

    def _is_finer(self, textures: Sequence[int], target: VisibleLatents) -> bool:
        """Return whether pixels of the view read finer mips than at the last call."""
        there = self._buffers.latent_store.finest[textures]
        if target.shown is not None:
            levels = dict.fromkeys(textures, 0) if target.needed is None else target.needed
            needed = np.array([levels.get(texture, NOT_VISIBLE) for texture in textures], np.int32)
            if not np.any(np.maximum(there, needed) < np.maximum(target.shown, needed)):
                return False
        target.shown = there
        return True

    def _ask(self, inputs: VisibilityInputs) -> None:
        """Let the GPU find the finest visible mip of each texture; `_take` receives the answer."""
        program = self._programs.compute("passes/needed_levels/needed_levels.comp", self._reading.defines())
        if self._levels is None:
            none = np.full(max(1, len(self._buffers.decoder_of_texture)), NOT_VISIBLE, np.int32).tobytes()
            memory = self._context.memory
            with memory.transaction():
                self._levels = memory.buffer(WHAT, none), memory.buffer(WHAT, none)
        levels, none_visible = self._levels
        inputs.bind()
        self._buffers.bind_records()
        self._context.gl.copy_buffer(levels, none_visible)
        levels.bind_to_storage_buffer(int(StorageBinding.RESULTS))
        program.run(*(-(-side // GROUP_SIDE) for side in inputs.visibility.size))
        self._context.gl.memory_barrier()
        self._back.copy([(levels, levels.size)], inputs)

    def _take(self, inputs: VisibilityInputs, target: VisibleLatents, budget: Budget) -> None:
        """Upload the mips of the last answer, which may be for an earlier view."""
        answer = self._back.arrived(budget.waits)
        if answer is None:
            return
        finest = np.frombuffer(answer[0], np.int32)
        levels = {int(index): int(finest[index]) for index in np.nonzero(finest < NOT_VISIBLE)[0]}
        if answer[1] == inputs:
            target.needed = levels
        else:
            self._buffers.ensure_resident(levels)

    def release(self) -> None:
        """Free the pass's buffers."""
        for part in (*(self._levels or ()), self._back):
            part.release()
        self._levels = None


def _first_small(pyramid: Sequence[LatentLevel]) -> int:
    """Return the finest level of at most FALLBACK_SIDE texels a side, else the coarsest; 0 for an empty pyramid."""
    sides = [max(level.texel_width, level.texel_height) for level in pyramid]
    return next((number for number, side in enumerate(sides) if side <= FALLBACK_SIDE), max(0, len(sides) - 1))
