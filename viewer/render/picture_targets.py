"""Render targets of the size of the picture."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from weakref import WeakKeyDictionary

from ntc.codec.maps import Plane
from viewer.render.frames import PairKey
from viewer.render.pass_scheduler import Output
from viewer.render.passes.blend_samples import BlendMean
from viewer.render.passes.visible_latents import VisibleLatents, VisibleLatentsPass
from viewer.render.resources.accumulator import SAMPLES
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.render.resources.visibility_buffer import ShownMaterials, SurfaceContent, VisibilityInputs, VisibilityTarget
from viewer.state.view_state import (
    DEFAULT_LIGHTING,
    FILTERED_PATHS,
    REFERENCE,
    MaterialView,
    Slot,
    ViewState,
    is_image_source,
)

PLANES_OF_VIEW: dict[MaterialView, tuple[Plane, ...]] = {
    "lit": ("base", "surface", "emission"),
    "base": ("base",),
    "normal": ("surface",),
    "orm": ("surface", "emission"),
    "emissive": ("emission",),
}
"""Planes of maps that each view reads."""


def surface_content(view: ViewState, scene_buffers: SceneBuffers) -> SurfaceContent:
    """Return the content that the passes of `view` read from the visibility buffer."""
    filters = any(is_image_source(slot.source) or slot.path in FILTERED_PATHS for slot in (view.slot_a, view.slot_b))
    return SurfaceContent(
        scene_buffers.has_colors,
        gradients=view.anisotropy > 1 and filters,
        frame=view.material_view == "lit",
        second_uvs=view.material_view != "base" and scene_buffers.has_second_uvs,
    )


@dataclass(frozen=True)
class PlaneKey:
    """Slot and one of the planes that it shows."""

    slot: Slot
    plane: Plane


def shown_materials(view: ViewState, inputs: VisibilityInputs) -> ShownMaterials:
    """Return the maps and the light that `view` shows; `inputs` says which materials may be visible."""
    planes = tuple(
        plane for plane in PLANES_OF_VIEW[view.material_view] if plane == "base" or inputs.plane_textures[plane]
    )
    lighting = view.lighting if view.material_view == "lit" else DEFAULT_LIGHTING
    return ShownMaterials(view.material_view, lighting, planes)


@dataclass(frozen=True, eq=False)
class Picture:
    """Picture of a slot."""

    target: ColorTarget
    output: Output
    """Output of the pass that drew the target."""
    source_version: int
    """Version of the pack that the picture shows; 0 for images."""


def _samples_left(picture: Picture) -> int:
    return max((item.left for item in picture.output.pending if item.part == "samples"), default=0)


@dataclass(eq=False)
class PictureTargets:
    """Targets of one picture size."""

    visibility: VisibilityTarget
    inputs: VisibilityInputs | None = None
    """Inputs of the last view, with its anisotropy; None before the first."""
    materials: ShownMaterials = field(default_factory=ShownMaterials)
    """Maps and light that the last view shows."""
    planes: dict[PlaneKey, ColorTarget] = field(default_factory=dict)
    shaded: dict[Slot, ColorTarget] = field(default_factory=dict)
    """Pictures of views other than `base`."""
    means: dict[Slot, BlendMean] = field(default_factory=dict)
    """Means of several samples, for views in which a BLEND surface may be visible."""
    latents: WeakKeyDictionary[VisibleLatentsPass, VisibleLatents] = field(default_factory=WeakKeyDictionary)
    """Mips of each pack that the view needs."""
    drawn: dict[Slot, Picture] = field(default_factory=dict)
    """Pictures of one sample, made from this visibility buffer."""
    shown: dict[Slot, Picture] = field(default_factory=dict)
    """Pictures to show: those of `drawn`, or means of several samples if BLEND surfaces may be visible."""
    plane_ms: dict[PlaneKey, float] = field(default_factory=dict)
    """Time in ms of the last drawing of each plane."""
    shaded_ms: dict[Slot, float] = field(default_factory=dict)
    """Time in ms of the last shading of each picture, without its planes; absent for the view `base`."""

    def show(self, inputs: VisibilityInputs, materials: ShownMaterials) -> None:
        """Set the view to draw. Pictures of another view are discarded."""
        if (inputs, materials) != (self.inputs, self.materials):
            self.drawn.clear()
            self.shown.clear()
        self.inputs, self.materials = inputs, materials

    @property
    def view(self) -> VisibilityInputs:
        """Inputs of the last view. Raises RuntimeError before the first."""
        if self.inputs is None:
            raise RuntimeError("draw the visibility buffer first")
        return self.inputs

    def inputs_of(self, key: PlaneKey) -> VisibilityInputs:
        """Return the inputs for drawing a plane. Only images and FILTERED_PATHS get anisotropic filtering."""
        inputs = self.view.of_plane(key.plane)
        filters = is_image_source(key.slot.source) or key.slot.path in FILTERED_PATHS
        return inputs if filters else replace(inputs, anisotropy=1)

    def picture(self, slot: Slot) -> ColorTarget:
        """Return the target with the picture of a slot. Raises KeyError for a slot that has not been drawn."""
        return self.shown[slot].target

    def samples(self, slots: Mapping[Slot, Slot]) -> dict[Slot, int]:
        """Return the number of samples in the pictures of `slots` (shown slot -> slot that draws it) with the stochastic filter."""
        sampled = {
            key: slot for key, slot in slots.items() if not is_image_source(slot.source) and slot.filter != "exact"
        }
        drawn = {key: self.drawn.get(slot) for key, slot in sampled.items()}
        return {key: 0 if picture is None else SAMPLES - _samples_left(picture) for key, picture in drawn.items()}

    def blend_samples(self, slot: Slot) -> int:
        """Return the number of samples in the picture that a slot shows."""
        mean = self.means.get(slot)
        return 1 if mean is None else mean.samples

    def samples_left(self, slot: Slot) -> int:
        """Return the number of samples that the shown picture of a slot still lacks."""
        picture = self.shown.get(slot)
        return 0 if picture is None else _samples_left(picture)

    def note_ms(self, owned: Mapping[Hashable, float]) -> None:
        """Store times in ms that have arrived from the GPU, by plane or by slot."""
        for owner, spent in owned.items():
            if isinstance(owner, PlaneKey) and owner in self.planes:
                self.plane_ms[owner] = spent
            elif isinstance(owner, Slot) and owner in self.shaded:
                self.shaded_ms[owner] = spent

    def slot_ms(self) -> dict[Slot, float]:
        """Return the time in ms of the last drawing of each slot: its planes in the last view, and its shading."""
        times: dict[Slot, float] = {}
        for key, spent in self.plane_ms.items():
            if key.plane in self.materials.planes:
                times[key.slot] = times.get(key.slot, 0.0) + spent
        if self.materials.view != "base":
            planes = {slot: times.get(replace(slot, maps="all"), 0.0) for slot in self.shaded_ms}
            times |= {slot: planes[slot] + spent for slot, spent in self.shaded_ms.items()}
        return times

    def pair_key(self, view: ViewState) -> PairKey:
        """Return the key of the content of both slots."""
        pictures = (self.shown.get(slot) for slot in (view.slot_a, view.slot_b))
        a, b = (0 if picture is None else picture.output.version for picture in pictures)
        return PairKey(view.slot_a, view.slot_b, (a, b))

    def release_unused(self, view: ViewState) -> None:
        """Free all but slots A and B and the reference, and planes that the view does not show."""
        slots = (view.slot_a, view.slot_b)
        planes_of = [replace(slot, maps="all") for slot in slots]
        for key in [
            k for k in self.planes if not self._is_used(k.slot, planes_of) or k.plane not in self.materials.planes
        ]:
            self.planes.pop(key).release()
            self.plane_ms.pop(key, None)
        for slot in [s for s in self.shaded if not self._is_used(s, slots) or self.materials.view == "base"]:
            self.shaded.pop(slot).release()
            self.shaded_ms.pop(slot, None)
        for pictures in (self.drawn, self.shown):
            for slot in [s for s in pictures if not self._is_used(s, slots)]:
                del pictures[slot]
        for slot in [s for s in self.means if not self._is_used(s, slots)]:
            self._release_mean(slot)

    def release_means(self) -> None:
        """Free the means: the view has no BLEND surface."""
        for slot in list(self.means):
            self._release_mean(slot)

    def _release_mean(self, slot: Slot) -> None:
        target = self.means.pop(slot).target
        if target is not None:
            target.release()

    @staticmethod
    def _is_used(slot: Slot, slots: Sequence[Slot]) -> bool:
        return slot in slots or slot.source == REFERENCE

    def release(self) -> None:
        """Free everything."""
        self.visibility.release()
        self.release_means()
        for target in (*self.planes.values(), *self.shaded.values()):
            target.release()
