"""Sources that are shown as images: the originals, and what the formats of graphics hardware make of them."""

from collections.abc import Collection, Mapping

import numpy as np

from ntc.metrics.block_compression import BlockFormat
from ntc.metrics.compressed_textures import CompressedTextures
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.render.passes.reference import ReferencePass
from viewer.scene.model import Scene
from viewer.state.view_state import REFERENCE


class ImageSources:
    """A pass for each source, over one visibility buffer. Images are uploaded when they are seen first."""

    def __init__(self, context: GraphicsContext, programs: ProgramFactory, scene: Scene, materials: np.ndarray) -> None:
        self._context, self._programs, self._scene, self._materials = context, programs, scene, materials
        self.reference = ReferencePass(context, programs, scene, materials)
        self._compressed: Mapping[str, CompressedTextures] = {}
        self._passes: dict[str, ReferencePass] = {}

    def __getitem__(self, source: str) -> ReferencePass:
        """The pass of a source. Raises KeyError where its textures have not been given."""
        if source == REFERENCE:
            return self.reference
        if source not in self._passes:
            textures = self._compressed[source]
            self._passes[source] = ReferencePass(
                self._context,
                self._programs,
                self._scene,
                self._materials,
                lambda texture_id: textures.textures[texture_id].mips(),
                source,
            )
        return self._passes[source]

    def set_compressed(self, compressed: Mapping[BlockFormat, CompressedTextures]) -> None:
        """The formats that slots may name from now on, with the scene's textures in their order."""
        self._compressed = {str(name): textures for name, textures in compressed.items()}
        self.keep_only(compressed)

    def keep_only(self, sources: Collection[str]) -> None:
        """Free the images of all other formats."""
        for source in [source for source in self._passes if source not in sources]:
            self._passes.pop(source).release()

    def release(self) -> None:
        """Free everything on the GPU."""
        self.keep_only(())
        self.reference.release()
