"""The reference path: original images, or others in their place, filtered by the hardware over the same visibility buffer.

Path `on-load` draws what it has compressed by the same pass.

Each plane of maps (`ntc.codec.maps`) has arrays of its own, in the format that is filtered as its maps are: sRGB or linear.
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
"""Function: texture id -> every mip down to 1x1 texel, as `plane_mips` returns them."""
DEFAULT_READING = PlaneReading()
MOST_AHEAD = 2 * (os.cpu_count() or 1)
"""Most images that are read before they are uploaded."""
SECONDS_BETWEEN_NEWS = 0.25
"""Time in seconds between showing new images: each time the whole plane is drawn again."""


class ImageUploads(RenderPass[Sequence[int], object]):
    """Pass that keeps the images of one source and plane on the GPU that the visible materials need.

    All of them, uploaded when a material that may be visible first needs them; or where that would take too much memory those in
    sight, which are read in threads beside the frames unless frames wait.
    """

    name = "upload"
    units = (TextureUnit.IMAGES,)
    """Texture units of an array."""
    defines: Mapping[str, int] = MappingProxyType({"LOADED": 0, "PARTS": 1})
    """Defines of the shader that samples them."""

    def __init__(
        self, context: GraphicsContext, places: ImagePlaces, mips: MipsOf, write_places: Callable[[], None], srgb: bool
    ) -> None:
        """Take `mips`, which returns images by texture id, in threads, and `write_places`, which hands changed places to shaders."""
        self._context, self._srgb = context, srgb
        self._mips, self._places, self._write_places = mips, places, write_places
        self.arrays: dict[int, tuple[ImageArrayPlan, ImageArray]] = {}
        """Texture arrays that shaders sample, by number."""
        self._uploaded: dict[ImagePlace, ImageContent] = {}
        self._pool: ThreadPoolExecutor | None = None
        self._coming: dict[ImageContent, Future[Sequence[NDArray[np.uint8]]]] = {}
        self._arrived: list[ImagePlace] = []
        """Places whose image is uploaded and not shown yet."""
        self._news_at = -math.inf
        self._shown = -1
        """Version of the places when a change was last reported."""

    @property
    def images_not_uploaded(self) -> int:
        """Number of images that no frame has needed so far, or that are not there any more."""
        return self._places.images - len(self._uploaded)

    @property
    def places(self) -> Output:
        """Output that changes with the places of images, which all sources that are shown as images share."""
        return Output(self._places.version)

    def bind(self) -> None:
        """Bind nothing: materials tell the places of their images."""

    def arrays_of(self, visible_materials: Sequence[int]) -> list[int]:
        """Return the numbers of the arrays that hold the images of these materials, ascending."""
        return sorted({place.array for place in self._places.of(visible_materials)})

    def advance(self, visible_materials: Sequence[int], _target: object, step: Step) -> Progress:
        """Upload the images of these materials that are not on the GPU yet, with their mip chains, into the arrays here.

        Where images are bounded, and this is not to be the whole picture, those that have been read so far.

        Where there is no memory the others are freed. If that is not enough, GpuMemoryError is raised: smaller images would be no
        reference.
        """
        whole, before = step.budget.waits, len(self._uploaded)
        self._places.want(visible_materials)
        self._forget_what_is_gone()
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

    def _forget_what_is_gone(self) -> None:
        for array in [array for array, (plan, _) in self.arrays.items() if self._places.plans.get(array) is not plan]:
            self._drop(array)
        content = self._places.content
        self._uploaded = {place: own for place, own in self._uploaded.items() if content.get(place) == own}
        self._arrived = [place for place in self._arrived if place in self._uploaded]

    def _drop(self, array: int) -> None:
        self.arrays.pop(array)[1].release()
        self._uploaded = {place: own for place, own in self._uploaded.items() if place.array != array}

    def _mips_of(self, content: ImageContent) -> Sequence[NDArray[np.uint8]]:
        return self._mips(content.texture)[content.level :]

    def _threads(self) -> ThreadPoolExecutor:
        self._pool = self._pool or ThreadPoolExecutor(os.cpu_count() or 1)
        return self._pool

    def _upload(self, wanted: Iterable[ImagePlace]) -> None:
        """Upload what is not there, waiting for it."""
        content = self._places.content
        fresh = sorted((place for place in wanted if place not in self._uploaded), key=lambda p: (p.array, p.layer))
        for start in range(0, len(fresh), MOST_AHEAD):
            # A few at a time: their pixels take memory until they are uploaded.
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
        """Upload pending images: all, or those that threads have read by now."""
        pending = self._places.pending
        if whole:
            self._upload(pending)
            self._arrived = list(pending)
        elif pending:
            self._read_ahead(pending)
        if not self._arrived:
            return
        now = time.monotonic()
        if whole or len(self._arrived) == len(pending) or now - self._news_at >= SECONDS_BETWEEN_NEWS:
            self._places.arrived(self._arrived)
            self._arrived, self._news_at = [], now
            self._forget_what_is_gone()
            self._write_places()

    def _read_ahead(self, pending: Mapping[ImagePlace, ImageContent]) -> None:
        for gone in self._coming.keys() - set(pending.values()):
            self._coming.pop(gone).cancel()
        for place, own in pending.items():
            if place in self._uploaded:
                continue
            if own in self._coming and self._coming[own].done():
                self._write(place, self._coming.pop(own).result())
                self._arrived.append(place)
            elif own not in self._coming and len(self._coming) < MOST_AHEAD:
                self._coming[own] = self._threads().submit(self._mips_of, own)

    def release(self) -> None:
        """Free the images."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
        for _, array in self.arrays.values():
            array.release()


class SampledArray(Protocol):
    """Texture array that shaders sample."""

    def use(self, unit: int, /) -> None:
        """Bind it from a texture unit on."""


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
        """Bind what the shader reads besides arrays and materials."""

    def release(self) -> None:
        """Free the images."""


Images = TypeVar("Images", bound=SampledImages)


class ReferencePass(RenderPass[VisibilityInputs, ColorTarget], Generic[Images]):
    """Pass that shows images. Inputs: visibility buffer, materials, images. Output: one plane of the materials' maps."""

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
        # One array, the common case, needs no depth to tell pixels apart.
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
