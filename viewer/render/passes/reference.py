"""The reference path: original images, or others in their place, filtered by the hardware over the same visibility buffer.

Each plane of maps (`ntc.codec.maps`) has arrays of its own, in the format that is filtered as its maps are: sRGB or linear.
"""

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import PLANES, Plane
from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.gl.texture_arrays import ImageArray
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.layout import BUCKET_DEPTHS, WRAP_CODES, TextureUnit
from viewer.render.resources.samplers import SamplerCache
from viewer.render.resources.visibility_buffer import PlaneReading, SurfaceContent, VisibilityInputs
from viewer.scene.map_pictures import plane_mips
from viewer.scene.model import Sampler, Scene
from viewer.state.view_state import REFERENCE

MipsOf = Callable[[int], Sequence[NDArray[np.uint8]]]
"""Texture id -> every mip down to 1x1 texel, as `plane_mips` gives them."""
DEFAULT_READING = PlaneReading()
LAYERS_AT_MOST = 256
"""Every OpenGL 4.3 driver has at least this many layers."""


@dataclass(frozen=True)
class ImagePlace:
    """Where a material finds its original image."""

    array: int
    layer: int


@dataclass(frozen=True)
class ImageArrayPlan:
    """Textures of one size that are sampled alike."""

    size: tuple[int, int]
    sampler: Sampler
    textures: tuple[int, ...]


def plan_image_arrays(scene: Scene, plane: Plane) -> tuple[tuple[ImageArrayPlan, ...], Mapping[int, ImagePlace]]:
    """Texture arrays of a plane for a scene, and the place of each textured material's image, by material index."""
    found = {index: material.plane(plane) for index, material in enumerate(scene.materials)}
    textured = {index: own for index, own in found.items() if own is not None}
    members: dict[tuple[tuple[int, int], Sampler], list[int]] = defaultdict(list)
    for own in textured.values():
        textures = members[(scene.textures[own.texture_id].size, own.sampler)]
        if own.texture_id not in textures:
            textures.append(own.texture_id)
    plans: list[ImageArrayPlan] = []
    place: dict[tuple[int, Sampler], ImagePlace] = {}
    for (size, sampler), textures in members.items():
        for start in range(0, len(textures), LAYERS_AT_MOST):
            part = textures[start : start + LAYERS_AT_MOST]
            place.update({(texture, sampler): ImagePlace(len(plans), layer) for layer, texture in enumerate(part)})
            plans.append(ImageArrayPlan(size, sampler, tuple(part)))
    places = {index: place[(own.texture_id, own.sampler)] for index, own in textured.items()}
    return tuple(plans), places


class ReferencePass:
    """Inputs: visibility buffer, materials, images. Output: one plane of the materials' maps.

    Images are uploaded when a material that may be visible first needs them.
    """

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        scene: Scene,
        materials: np.ndarray,
        mips: MipsOf | None = None,
        name: str = REFERENCE,
        reading: PlaneReading = DEFAULT_READING,
    ) -> None:
        """`mips` gives the images by texture id, in threads; None: the scene's own. `name` is that of the source."""
        self._context, self.name, self._reading, plane = context, name, reading, reading.plane
        self._mips: MipsOf = mips or (lambda texture_id: plane_mips(scene.textures[texture_id], plane))
        self._plans, self._places = plan_image_arrays(scene, plane)
        for index, place in self._places.items():
            own = materials[index]["planes"][PLANES.index(plane)]
            own["image_array"], own["image_layer"] = place.array, place.layer
        self._arrays: dict[int, ImageArray] = {}
        self._samplers = SamplerCache(context)
        self._uploaded: set[tuple[int, int]] = set()
        self._programs = programs
        self._depth: moderngl.Texture | None = None

    @property
    def images_not_uploaded(self) -> int:
        """Images that no frame has needed so far."""
        return len(set(self._places.values())) - len(self._uploaded)

    def upload(self, visible_materials: Iterable[int]) -> None:
        """Upload the images of these materials that are not on the GPU yet, with their mip chains.

        Where there is no memory the others are freed. If that is not enough, GpuMemoryError is raised: smaller images would be no
        reference.
        """
        wanted = {self._places[index] for index in visible_materials if index in self._places}
        try:
            self._upload(wanted)
        except GpuMemoryError:
            if not self._drop_all_but({place.array for place in wanted}):
                raise
            self._upload(wanted)

    def _drop_all_but(self, wanted: Collection[int]) -> bool:
        """Free all other arrays; whether there were any."""
        others = [array for array in self._arrays if array not in wanted]
        for array in others:
            self._drop(array)
        return bool(others)

    def _drop(self, array: int) -> None:
        self._arrays.pop(array).release()
        self._uploaded = {place for place in self._uploaded if place[0] != array}

    def _upload(self, wanted: Collection[ImagePlace]) -> None:
        fresh = sorted((p.array, p.layer) for p in wanted if (p.array, p.layer) not in self._uploaded)
        if not fresh:
            return
        textures = [self._plans[array].textures[layer] for array, layer in fresh]
        with ThreadPoolExecutor() as pool:
            chains = pool.map(self._mips, textures)
            for (array, layer), chain in zip(fresh, chains, strict=True):
                if array not in self._arrays:
                    plan = self._plans[array]
                    self._arrays[array] = ImageArray(
                        self._context, plan.size, len(plan.textures), srgb=self._reading.plane != "surface"
                    )
                try:
                    self._arrays[array].write(layer, chain)
                except GpuMemoryError:
                    self._drop(array)
                    raise
                self._uploaded.add((array, layer))

    def _depth_texture(self, size: tuple[int, int]) -> moderngl.Texture:
        if self._depth is None or self._depth.size != size:
            made = self._context.memory.depth_texture(f"depth of the reference {size[0]}x{size[1]}", size)
            if self._depth is not None:
                self._depth.release()
            self._depth = made
        return self._depth

    def run(self, inputs: VisibilityInputs, target: ColorTarget) -> None:
        """Draw the plane, once the visible materials have been uploaded."""
        visibility, anisotropy = inputs.visibility, inputs.anisotropy
        gl = self._context.gl
        arrays = sorted({self._places[index].array for index in inputs.visible_materials if index in self._places})
        # One array, the common case, needs no depth to tell pixels apart.
        sorts = len(arrays) > 1
        framebuffer = target.framebuffer_with_depth(self._depth_texture(target.size)) if sorts else target.framebuffer
        try:
            framebuffer.use()
            inputs.bind()
            gl.enable_only(moderngl.DEPTH_TEST if sorts else moderngl.NOTHING)
            gl.depth_func = "1"
            framebuffer.depth_mask = sorts
            first = arrays[0] if arrays else -1
            self._draw(first, anisotropy, visibility.content, {"FIRST": 1, "SORTS": int(sorts)})
            framebuffer.depth_mask = False
            gl.depth_func = "=="
            for array in arrays[1:]:
                self._draw(array, anisotropy, visibility.content, {"FIRST": 0, "SORTS": 0})
        finally:
            gl.depth_func = "<"

    def _draw(self, array: int, anisotropy: int, content: SurfaceContent, variant: Mapping[str, int]) -> None:
        """Draw the pixels of one texture array; -1 for none."""
        defines = {**self._reading.defines(), "GRADIENTS": int(content.gradients), **variant}
        triangle = self._programs.fullscreen("passes/reference/sample.frag", defines)
        set_uniforms(triangle.program, {"depth": (array + 1) / BUCKET_DEPTHS, "first_array": array})
        unit = int(TextureUnit.IMAGES)
        if array < 0:
            triangle.render(moderngl.TRIANGLES, vertices=3)
            return
        self._arrays[array].use(unit)
        set_uniforms(
            triangle.program, {"wrap": tuple(int(WRAP_CODES[mode]) for mode in self._plans[array].sampler.wrap)}
        )
        sampler = self._samplers.get(self._plans[array].sampler, anisotropy)
        sampler.use(unit)
        triangle.render(moderngl.TRIANGLES, vertices=3)
        sampler.clear(unit)

    def release(self) -> None:
        """Free images, samplers and depth."""
        for array in self._arrays.values():
            array.release()
        self._samplers.release()
        if self._depth is not None:
            self._depth.release()
