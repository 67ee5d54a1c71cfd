"""Reference pass: images, filtered by the hardware over the visibility buffer. They are the originals or compressed versions.

Path `on-load` draws its compressed textures with the same pass.

Each plane of maps (`ntc.codec.maps`) has separate texture arrays, in an sRGB or a linear format as its maps need.
"""

import math
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from types import MappingProxyType
from typing import Generic, Protocol, TypeVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.codec.gpu import WRAP_CODES
from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.gl.texture_arrays import ImageArray
from viewer.render.pass_scheduler import Output, Pending, Progress, RenderPass, Step
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.image_places import ImageArrayPlan, ImageContent, ImagePlace, ImagePlaces
from viewer.render.resources.layout import BUCKET_DEPTHS, TextureUnit
from viewer.render.resources.samplers import SamplerCache
from viewer.render.resources.visibility_buffer import PlaneReading, SurfaceContent, VisibilityInputs
from viewer.state.view_state import REFERENCE

MipsOf = Callable[[int], Sequence[NDArray[np.uint8]]]
"""Function: texture id -> all mips down to 1x1 texel, as `plane_mips` returns them."""
DEFAULT_READING = PlaneReading()
MOST_AHEAD = 2 * (os.cpu_count() or 1)
"""Most images in CPU memory that wait for their upload."""
SECONDS_BETWEEN_UPDATES = 0.25
"""Time in seconds between two updates that show new images, because each draws the whole plane again."""


class ImageUploads(RenderPass[Sequence[int], object]):
    """Pass that uploads the images of visible materials, for one source and plane.

    Uploaded images stay. If all images exceed the budget, only those in sight stay, and threads read them in the background unless
    frames wait.
    """

    name = "upload"
    units = (TextureUnit.IMAGES,)
    """Texture units of an array."""
    defines: Mapping[str, int] = MappingProxyType({"LOADED": 0, "PARTS": 1})
    """Defines of the shader that samples them."""

    def __init__(
        self, context: GraphicsContext, places: ImagePlaces, mips: MipsOf, write_places: Callable[[], None], srgb: bool
    ) -> None:
        """Take `mips`, which threads call, and `write_places`, which uploads changed places for shaders."""
        self._context, self._srgb = context, srgb
        self._mips, self._places, self._write_places = mips, places, write_places
        self.arrays: dict[int, tuple[ImageArrayPlan, ImageArray]] = {}
        """Texture arrays that shaders sample, by number."""
        self._uploaded: dict[ImagePlace, ImageContent] = {}
        self._pool: ThreadPoolExecutor | None = None
        self._coming: dict[ImageContent, Future[Sequence[NDArray[np.uint8]]]] = {}
        self._arrived: list[ImagePlace] = []
        """Places whose image is uploaded but not shown yet."""
        self._shown_at = -math.inf
        self._shown = -1
        """Version of the places at the last reported change."""

    @property
    def images_not_uploaded(self) -> int:
        """Number of images that are not on the GPU: no frame has needed them, or others took their place."""
        return self._places.images - len(self._uploaded)

    @property
    def places(self) -> Output:
        """Output whose version changes with the places of images. All image sources share the places."""
        return Output(self._places.version)

    def bind(self) -> None:
        """Bind nothing, because the material records hold the places of images."""

    def arrays_of(self, visible_materials: Sequence[int]) -> list[int]:
        """Return the numbers of the arrays that hold the images of these materials, ascending."""
        return sorted({place.array for place in self._places.of(visible_materials)})

    def advance(self, visible_materials: Sequence[int], _target: object, step: Step) -> Progress:
        """Upload the missing images of these materials with all mips.

        If a budget bounds the images, and the picture need not be whole, only those that threads have read are uploaded.

        If memory runs out, images out of sight are freed. If that is not enough, GpuMemoryError is raised, because smaller images
        would be no reference.
        """
        whole, before = step.budget.waits, len(self._uploaded)
        self._places.want(visible_materials)
        self._drop_stale()
        wanted = self._places.of(visible_materials)
        try:
            self._upload(wanted)
            self._upload_coming(whole)
        except GpuMemoryError:
            others = self.arrays.keys() - {place.array for place in wanted}
            if not others:
                raise
            for array in others:
                self._drop(array)
            self._upload(wanted)
            self._upload_coming(whole)
        has_changed = self._shown != self._places.version or len(self._uploaded) != before
        self._shown = self._places.version
        left = len(self._places.pending)
        return Progress(has_changed, (Pending("images", left, self._places.in_sight),) if left else ())

    def _drop_stale(self) -> None:
        for array in [array for array, (plan, _) in self.arrays.items() if self._places.plans.get(array) is not plan]:
            self._drop(array)
        content = self._places.content
        self._uploaded = {place: image for place, image in self._uploaded.items() if content.get(place) == image}
        self._arrived = [place for place in self._arrived if place in self._uploaded]

    def _drop(self, array: int) -> None:
        self.arrays.pop(array)[1].release()
        self._uploaded = {place: image for place, image in self._uploaded.items() if place.array != array}

    def _mips_of(self, content: ImageContent) -> Sequence[NDArray[np.uint8]]:
        return self._mips(content.texture)[content.level :]

    def _threads(self) -> ThreadPoolExecutor:
        self._pool = self._pool or ThreadPoolExecutor(os.cpu_count() or 1)
        return self._pool

    def _upload(self, wanted: Iterable[ImagePlace]) -> None:
        """Upload the missing images of `wanted`; waits for the threads that read them."""
        content = self._places.content
        fresh = sorted((place for place in wanted if place not in self._uploaded), key=lambda p: (p.array, p.layer))
        for start in range(0, len(fresh), MOST_AHEAD):
            # A few at a time, because their pixels take memory until they are uploaded.
            part = fresh[start : start + MOST_AHEAD]
            chains = self._threads().map(self._mips_of, [content[place] for place in part])
            for place, chain in zip(part, chains, strict=True):
                self._write(place, chain)

    def _write(self, place: ImagePlace, chain: Sequence[NDArray[np.uint8]]) -> None:
        if place.array not in self.arrays:
            plan = self._places.plans[place.array]
            made = ImageArray(self._context, plan.size, plan.layers, srgb=self._srgb)
            self.arrays[place.array] = plan, made
        try:
            self.arrays[place.array][1].write(place.layer, chain)
        except GpuMemoryError:
            self._drop(place.array)
            raise
        self._uploaded[place] = self._places.content[place]

    def _upload_coming(self, whole: bool) -> None:
        """Upload pending images: all, or those that threads have read so far."""
        pending = self._places.pending
        if whole:
            self._upload(pending)
            self._arrived = list(pending)
        elif pending:
            self._read_ahead(pending)
        if not self._arrived:
            return
        now = time.monotonic()
        if whole or len(self._arrived) == len(pending) or now - self._shown_at >= SECONDS_BETWEEN_UPDATES:
            self._places.arrived(self._arrived)
            self._arrived, self._shown_at = [], now
            self._drop_stale()
            self._write_places()

    def _read_ahead(self, pending: Mapping[ImagePlace, ImageContent]) -> None:
        for gone in self._coming.keys() - set(pending.values()):
            self._coming.pop(gone).cancel()
        for place, content in pending.items():
            if place in self._uploaded:
                continue
            if content in self._coming and self._coming[content].done():
                self._write(place, self._coming.pop(content).result())
                self._arrived.append(place)
            elif content not in self._coming and len(self._coming) < MOST_AHEAD:
                self._coming[content] = self._threads().submit(self._mips_of, content)

    def release(self) -> None:
        """Free the images."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
        for _, array in self.arrays.values():
            array.release()


class SampledArray(Protocol):
    """Texture array that shaders can sample."""

    def use(self, unit: int, /) -> None:
        """Bind the array to texture units from `unit` on."""


class SampledImages(Protocol):
    """Images of one plane in texture arrays."""

    @property
    def arrays(self) -> Mapping[int, tuple[ImageArrayPlan, SampledArray]]:
        """Texture arrays by number."""

    @property
    def units(self) -> Sequence[TextureUnit]:
        """Texture units that an array takes."""

    @property
    def defines(self) -> Mapping[str, int]:
        """Defines of the shader that samples them."""

    def arrays_of(self, visible_materials: Sequence[int]) -> list[int]:
        """Return the numbers of the arrays that hold the images of these materials, ascending."""

    def bind(self) -> None:
        """Bind the buffers that the shader reads besides arrays and materials."""

    def release(self) -> None:
        """Free the images."""


Images = TypeVar("Images", bound=SampledImages)


class ReferencePass(RenderPass[VisibilityInputs, ColorTarget], Generic[Images]):
    """Pass that draws images. Inputs: visibility buffer, materials, images. Output: one plane of the materials' maps.

    OpenGL 4.3 cannot choose among texture arrays by a number that differs from pixel to pixel. So each array is drawn once, over the
    whole picture. The first drawing writes the number of each pixel's array as its depth; the depth test then admits exactly the
    pixels of the array that is drawn.
    """

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        uploads: Images,
        name: str = REFERENCE,
        reading: PlaneReading = DEFAULT_READING,
    ) -> None:
        """Take the name of the source as `name`."""
        self._context, self.name, self._reading = context, name, reading
        self.uploads = uploads
        self._samplers = SamplerCache(context)
        self._programs = programs
        self._depth: moderngl.Texture | None = None

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
        arrays = self.uploads.arrays_of(inputs.visible_materials)
        # A single array, the common case, needs no depth.
        sorts = len(arrays) > 1
        framebuffer = target.framebuffer_with_depth(self._depth_texture(target.size)) if sorts else target.framebuffer
        try:
            framebuffer.use()
            inputs.bind()
            self.uploads.bind()
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
        defines = {**self._reading.defines(), "GRADIENTS": int(content.gradients), **self.uploads.defines, **variant}
        triangle = self._programs.fullscreen("passes/reference/sample.frag", defines)
        set_uniforms(triangle.program, {"depth": (array + 1) / BUCKET_DEPTHS, "first_array": array})
        if array < 0:
            triangle.render(moderngl.TRIANGLES, vertices=3)
            return
        plan, images = self.uploads.arrays[array]
        images.use(int(TextureUnit.IMAGES))
        set_uniforms(triangle.program, {"wrap": tuple(int(WRAP_CODES[mode]) for mode in plan.sampler.wrap)})
        sampler = self._samplers.get(plan.sampler, anisotropy)
        for unit in self.uploads.units:
            sampler.use(int(unit))
        triangle.render(moderngl.TRIANGLES, vertices=3)
        for unit in self.uploads.units:
            sampler.clear(int(unit))

    def release(self) -> None:
        """Free images, samplers and depth."""
        self.uploads.release()
        self._samplers.release()
        if self._depth is not None:
            self._depth.release()
