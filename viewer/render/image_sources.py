"""Sources that are shown as images: the originals, and what the formats of graphics hardware make of them."""

from collections.abc import Collection, Mapping

import numpy as np

from ntc.codec.maps import PLANES, Plane
from ntc.metrics.block_compression import BlockFormat
from ntc.metrics.compressed_textures import CompressedTextures
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.render.passes.reference import ReferencePass
from viewer.render.resources.visibility_buffer import PlaneReading
from viewer.scene.map_pictures import compressed_plane_mips
from viewer.scene.model import Scene
from viewer.state.view_state import REFERENCE


class ImageSources:
    """A pass for each source and plane of maps, over one visibility buffer. Images are uploaded when they are seen first."""

    def __init__(self, context: GraphicsContext, programs: ProgramFactory, scene: Scene, materials: np.ndarray) -> None:
        self._context, self._programs, self._scene, self._materials = context, programs, scene, materials
        self._reference = {
            plane: ReferencePass(context, programs, scene, materials, reading=self._reading(plane)) for plane in PLANES
        }
        self._compressed: Mapping[str, CompressedTextures] = {}
        self._passes: dict[tuple[str, Plane], ReferencePass] = {}

    def _reading(self, plane: Plane) -> PlaneReading:
        geometry = self._scene.geometry
        return PlaneReading(plane, geometry.colors is not None, geometry.second_uvs is not None)

    @property
    def images_not_uploaded(self) -> int:
        """Original images that no frame has needed so far."""
        return sum(images.images_not_uploaded for images in self._reference.values())

    def holds(self, source: str, plane: Plane) -> bool:
        """Whether a source has images of a plane: formats of graphics hardware may be there for base colours alone."""
        return source == REFERENCE or plane == "base" or bool(self._compressed[source].further)

    def of(self, source: str, plane: Plane) -> ReferencePass:
        """The pass of a source that holds the plane. Raises KeyError where its textures have not been given."""
        if source == REFERENCE:
            return self._reference[plane]
        key = source, plane
        if key not in self._passes:
            textures = self._compressed[source]
            self._passes[key] = ReferencePass(
                self._context,
                self._programs,
                self._scene,
                self._materials,
                lambda texture_id: compressed_plane_mips(textures, texture_id, plane),
                source,
                self._reading(plane),
            )
        return self._passes[key]

    def set_compressed(self, compressed: Mapping[BlockFormat, CompressedTextures]) -> None:
        """The formats that slots may name from now on, with the scene's textures in their order."""
        self._compressed = {str(name): textures for name, textures in compressed.items()}
        self.keep_only(compressed)

    def keep_only(self, sources: Collection[str]) -> None:
        """Free the images of all other formats."""
        for key in [key for key in self._passes if key[0] not in sources]:
            self._passes.pop(key).release()

    def release(self) -> None:
        """Free everything on the GPU."""
        self.keep_only(())
        for images in self._reference.values():
            images.release()
