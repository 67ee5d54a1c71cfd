"""Divergence pass: counts the distinct decoders of each block, from the visibility buffer and texture -> decoder tables."""

from dataclasses import dataclass

import moderngl

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.pass_scheduler import RenderPass
from viewer.render.resources.divergence_maps import DecoderTables, DivergenceTarget, Stage
from viewer.render.resources.layout import GROUP_SIDE, ImageUnit, StorageBinding
from viewer.render.resources.visibility_buffer import VisibilityTarget


@dataclass(frozen=True)
class DivergenceInputs:
    """Inputs of the divergence pass. Equal inputs give equal maps."""

    visibility: VisibilityTarget
    version: int
    """Version of the visibility buffer's content."""
    tables: DecoderTables


class DivergencePass(RenderPass[DivergenceInputs, DivergenceTarget]):
    """Pass that counts decoders. Output: a DivergenceTarget with as many maps as there are tables."""

    name = "divergence"

    def __init__(self, context: GraphicsContext, programs: ProgramFactory, stage: Stage = "compute") -> None:
        self._gl = context.gl
        self._programs = programs
        self._stage: Stage = stage

    def run(self, inputs: DivergenceInputs, target: DivergenceTarget) -> None:
        """Count the decoders of every block under every grouping."""
        defines = {"BLOCK_WIDTH": target.block[0], "BLOCK_HEIGHT": target.block[1]}
        values = {"picture": target.picture, "textures": inputs.tables.textures, "rows": target.size[1]}
        inputs.visibility.bind()
        inputs.tables.bind()
        target.counted_by = self._stage
        if self._stage == "compute":
            # clear() would map the buffer and wait.
            target.histogram.write(bytes(target.histogram.size))
            target.histogram.bind_to_storage_buffer(int(StorageBinding.RESULTS))
            target.texture.bind_to_image(int(ImageUnit.DIVERGENCE), read=False, write=True)
            program = self._programs.compute("passes/divergence/divergence.comp", defines)
            set_uniforms(program, values)
            program.run(*(-(-side // GROUP_SIDE) for side in target.texture.size))
            self._gl.memory_barrier()
            return
        triangle = self._programs.fullscreen("passes/divergence/divergence.frag", defines)
        set_uniforms(triangle.program, {**values, "depth": 0.0})
        target.framebuffer.use()
        self._gl.enable_only(moderngl.NOTHING)
        triangle.render(moderngl.TRIANGLES, vertices=3)
