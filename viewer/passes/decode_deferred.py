"""Decode path `deferred`: a compute pass decodes every visible pixel once, over the visibility buffer."""

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.passes.albedo_target import AlbedoTarget
from viewer.passes.layout import GROUP_SIDE, ImageUnit
from viewer.passes.pack_buffers import PackBuffers
from viewer.passes.scene_buffers import SceneBuffers
from viewer.passes.visibility import VisibilityTarget


class DecodeDeferredPass:
    """Inputs: visibility buffer, materials, a pack. Output: linear albedo."""

    def __init__(self, context: GraphicsContext, programs: ProgramFactory, pack: PackBuffers, colors: bool) -> None:
        self._gl = context.gl
        self._pack = pack
        self._program = programs.compute(
            "passes/decode_deferred/decode.comp",
            {"VERTEX_COLORS": int(colors), "PRECISION_FP16": int(pack.precision == "fp16")},
        )

    def run(self, visibility: VisibilityTarget, scene_buffers: SceneBuffers, target: AlbedoTarget) -> None:
        """Decode the whole picture."""
        visibility.bind()
        scene_buffers.bind_materials()
        self._pack.bind()
        target.texture.bind_to_image(int(ImageUnit.ALBEDO), read=False, write=True)
        set_uniforms(self._program, {"network_blocks": self._pack.hidden_blocks})
        self._program.run(*(-(-side // GROUP_SIDE) for side in target.size))
        self._gl.memory_barrier()
