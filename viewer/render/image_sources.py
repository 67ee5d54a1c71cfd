"""Sources that are images: the originals, and their versions in the formats of graphics hardware."""

from collections.abc import Collection, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import PLANES, Plane
from ntc.metrics.block_compression import BlockFormat
from ntc.metrics.compressed_textures import CompressedTextures
from viewer.render.passes.reference import ImageUploads, MipsOf, ReferencePass
from viewer.render.render_context import RenderContext
from viewer.render.resources.image_places import DEFAULT_BYTES, ImagePlaces, plane_bytes
from viewer.render.resources.visibility_buffer import PlaneReading
from viewer.scene.map_pictures import compressed_plane_mips, plane_mips
from viewer.state.view_state import REFERENCE


class ImageSources:
    """Passes that draw images, one for each source and plane of maps. Images are uploaded when they first come into sight."""

    def __init__(self, context: RenderContext, most_bytes: int = DEFAULT_BYTES) -> None:
        """Place the images. If a source exceeds `most_bytes`, only its images in sight are on the GPU, reduced to fit."""
        self._context, self._scene, scene = context, context.scene, context.scene
        self._buffers = context.scene_buffers
        sizes = {plane: plane_bytes(scene, plane) for plane in PLANES}
        total = max(sum(sizes.values()), 1)
        # Each plane has its share of the budget.
        self._places = {
            plane: ImagePlaces(scene, plane, size if total <= most_bytes else most_bytes * size // total)
            for plane, size in sizes.items()
        }
        for places in self._places.values():
            places.write(self._buffers.materials)
        self._buffers.upload_materials()
        self._reference = {plane: self._pass(REFERENCE, plane, partial(self._mips, plane)) for plane in PLANES}
        self._compressed: Mapping[str, CompressedTextures] = {}
        self._passes: dict[tuple[str, Plane], ReferencePass[ImageUploads]] = {}

    def _pass(self, source: str, plane: Plane, mips: MipsOf) -> ReferencePass[ImageUploads]:
        write = partial(self._write_places, plane)
        graphics, buffers = self._context.graphics, self._buffers
        uploads = ImageUploads(graphics, self._places[plane], mips, write, srgb=plane != "surface")
        reading = PlaneReading(plane, buffers.has_colors, buffers.has_second_uvs)
        return ReferencePass(graphics, self._context.programs, uploads, source, reading)

    def _mips(self, plane: Plane, texture_id: int) -> Sequence[NDArray[np.uint8]]:
        return plane_mips(self._scene.textures[texture_id], plane)

    def _write_places(self, plane: Plane) -> None:
        self._places[plane].write(self._buffers.materials)
        self._buffers.upload_materials()

    @property
    def largest_side(self) -> int | None:
        """Largest side in texels of the images in sight if the budget reduces them; else None."""
        sides = [places.side for places in self._places.values() if places.is_bounded]
        return min(sides, default=None)

    @property
    def images_not_uploaded(self) -> int:
        """Number of original images that no frame has needed so far."""
        return sum(images.uploads.images_not_uploaded for images in self._reference.values())

    def holds(self, source: str, plane: Plane) -> bool:
        """Return whether a source has images of a plane; formats of graphics hardware may have only base colours."""
        return source == REFERENCE or plane == "base" or bool(self._compressed[source].further)

    def of(self, source: str, plane: Plane) -> ReferencePass[ImageUploads]:
        """Return the pass that draws a plane of a source. Raises KeyError before `set_compressed` has given its textures."""
        if source == REFERENCE:
            return self._reference[plane]
        key = source, plane
        if key not in self._passes:
            textures = self._compressed[source]
            mips = partial(compressed_plane_mips, textures, plane=plane)
            self._passes[key] = self._pass(source, plane, mips)
        return self._passes[key]

    def set_compressed(self, compressed: Mapping[BlockFormat, CompressedTextures]) -> None:
        """Set the compressed formats that slots may show, each with all textures of the scene in order."""
        self._compressed = {str(name): textures for name, textures in compressed.items()}
        self.keep_only(compressed)

    def keep_only(self, sources: Collection[str]) -> None:
        """Free the images of all other compressed formats."""
        for key in [key for key in self._passes if key[0] not in sources]:
            self._passes.pop(key).release()

    def release(self) -> None:
        """Free everything on the GPU."""
        self.keep_only(())
        for images in self._reference.values():
            images.release()
