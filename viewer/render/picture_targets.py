"""Everything on the GPU that has the size of the picture, and what it was drawn from."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from ntc.codec.maps import Plane
from viewer.render.frame_result import PairKey
from viewer.render.passes.composite import CompositeTarget
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.render.resources.visibility_buffer import SurfaceContent, VisibilityInputs, VisibilityTarget
from viewer.state.view_state import (
    DEFAULT_LIGHTING,
    REFERENCE,
    Lighting,
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
"""Planes that each view reads."""


def surface_content(view: ViewState, scene_buffers: SceneBuffers) -> SurfaceContent:
    """What the visibility buffer of `view` must hold: no more than its passes read."""
    filters = any(is_image_source(slot.source) or slot.path == "cached" for slot in (view.slot_a, view.slot_b))
    return SurfaceContent(
        scene_buffers.has_colors,
        gradients=view.anisotropy > 1 and filters,
        frame=view.material_view == "lit",
        second_uvs=view.material_view != "base" and scene_buffers.has_second_uvs,
    )


@dataclass(frozen=True)
class PlaneKey:
    """One plane of what a slot shows."""

    slot: Slot
    plane: Plane


def base_key(slot: Slot) -> PlaneKey:
    """The plane that is the picture of the view `base`: of a slot that shows another map alone, the original's."""
    return PlaneKey(replace(slot, maps="all") if slot.maps in ("all", "base") else Slot(), "base")


@dataclass(frozen=True)
class DrawnPlane:
    """What a plane of a slot was made from."""

    inputs: VisibilityInputs
    version: int
    """Of the slot's pack; 0 for images."""
    number: int
    """Of the drawing: differs whenever the content may."""


@dataclass(frozen=True)
class ShownMaterials:
    """What of the materials a picture shows."""

    view: MaterialView = "base"
    lighting: Lighting = DEFAULT_LIGHTING
    """Of no effect but in the view `lit`."""
    planes: tuple[Plane, ...] = ("base",)
    """Those of the view that some visible material has; of the others all is neutral."""


def shown_materials(view: ViewState, inputs: VisibilityInputs) -> ShownMaterials:
    """What `view` shows of the materials that `inputs` may see."""
    planes = tuple(
        plane for plane in PLANES_OF_VIEW[view.material_view] if plane == "base" or inputs.plane_textures[plane]
    )
    lighting = view.lighting if view.material_view == "lit" else DEFAULT_LIGHTING
    return ShownMaterials(view.material_view, lighting, planes)


@dataclass(frozen=True)
class PictureKey:
    """What the picture of a slot was made from, for views other than `base`."""

    materials: ShownMaterials
    planes: tuple[tuple[PlaneKey, int], ...]
    """With the number of each drawing."""
    inputs: VisibilityInputs


@dataclass(frozen=True)
class DrawnPicture:
    """The picture of a slot, for views other than `base`."""

    key: PictureKey
    number: int
    """Of the drawing: differs whenever the content may."""


@dataclass
class BlendMean:
    """The mean of a slot's picture and further ones, for which BLEND surfaces were drawn against other patterns of thresholds."""

    own: int
    """Number of the drawing of the slot's own picture, which is the first sample."""
    number: int
    """Of the drawing: differs whenever the content may; `own` while there is one sample."""
    samples: int = 1
    target: ColorTarget | None = None
    """Of no meaning while there is one sample."""


@dataclass
class PictureTargets:
    """Targets of one picture size."""

    visibility: VisibilityTarget
    composite: CompositeTarget
    inputs: VisibilityInputs | None = None
    """Of the last view, with its anisotropy; None before the first."""
    materials: ShownMaterials = ShownMaterials()
    """Of the last view."""
    planes: dict[PlaneKey, ColorTarget] = field(default_factory=dict)
    drawn: dict[PlaneKey, DrawnPlane] = field(default_factory=dict)
    """Of each plane that is whole."""
    pictures: dict[Slot, ColorTarget] = field(default_factory=dict)
    """Of views other than `base`."""
    drawn_pictures: dict[Slot, DrawnPicture] = field(default_factory=dict)
    means: dict[Slot, BlendMean] = field(default_factory=dict)
    """Of views in which a BLEND surface may be seen."""
    plane_ms: dict[PlaneKey, float] = field(default_factory=dict)
    """Time that each plane took when it was last drawn."""
    picture_ms: dict[Slot, float] = field(default_factory=dict)
    """The same for pictures of views other than `base`, without their planes."""

    def inputs_of(self, key: PlaneKey) -> VisibilityInputs:
        """What a plane is drawn from: only images and path `cached` filter anisotropically."""
        if self.inputs is None:
            raise RuntimeError("draw the visibility buffer first")
        inputs = self.inputs.of_plane(key.plane)
        filters = is_image_source(key.slot.source) or key.slot.path == "cached"
        return inputs if filters else replace(inputs, anisotropy=1)

    def picture(self, slot: Slot) -> ColorTarget:
        """What is shown of a slot that has been drawn. Raises KeyError for others."""
        mean = self.mean(slot)
        if mean is not None and mean.samples > 1 and mean.target is not None:
            return mean.target
        return self.own_picture(slot)

    def mean(self, slot: Slot) -> BlendMean | None:
        """The mean that holds the slot's own picture as it is; None where there is none."""
        mean = self.means.get(slot)
        return mean if mean is not None and mean.own == self.own_number(slot) else None

    def own_picture(self, slot: Slot) -> ColorTarget:
        """The picture of a slot that has been drawn, from the visibility buffer here. Raises KeyError for others."""
        return self.planes[base_key(slot)] if self.materials.view == "base" else self.pictures[slot]

    def has_picture(self, slot: Slot) -> bool:
        """Whether there is one."""
        return base_key(slot) in self.planes if self.materials.view == "base" else slot in self.pictures

    def number(self, slot: Slot) -> int:
        """Number of the drawing of what is shown of a slot; 0 where there is nothing."""
        mean = self.mean(slot)
        return mean.number if mean is not None else self.own_number(slot)

    def own_number(self, slot: Slot) -> int:
        """Number of the drawing of the slot's own picture; 0 where there is none."""
        drawn: DrawnPlane | DrawnPicture | None = (
            self.drawn.get(base_key(slot)) if self.materials.view == "base" else self.drawn_pictures.get(slot)
        )
        return drawn.number if drawn is not None else 0

    def note_ms(self, owned: Mapping[Hashable, float]) -> None:
        """Take over times in ms, by plane or by slot, that have become known."""
        for owner, spent in owned.items():
            if isinstance(owner, PlaneKey) and owner in self.planes:
                self.plane_ms[owner] = spent
            elif isinstance(owner, Slot) and owner in self.pictures:
                self.picture_ms[owner] = spent

    def slot_ms(self) -> dict[Slot, float]:
        """Time that each slot took when it was last drawn: its planes of the last view, and the picture."""
        found: dict[Slot, float] = {}
        for key, spent in self.plane_ms.items():
            if key.plane in self.materials.planes:
                found[key.slot] = found.get(key.slot, 0.0) + spent
        if self.materials.view != "base":
            planes = {slot: found.get(replace(slot, maps="all"), 0.0) for slot in self.picture_ms}
            found |= {slot: planes[slot] + spent for slot, spent in self.picture_ms.items()}
        return found

    def pair_key(self, view: ViewState) -> PairKey:
        """Stands for the content of both slots."""
        return PairKey(view.slot_a, view.slot_b, (self.number(view.slot_a), self.number(view.slot_b)))

    def release_unused(self, view: ViewState) -> None:
        """Free all but slots A and B and the reference, and planes that the view does not show."""
        slots = (view.slot_a, view.slot_b)
        planes_of = [replace(slot, maps="all") for slot in slots]
        for key in [
            k for k in self.planes if not self._is_used(k.slot, planes_of) or k.plane not in self.materials.planes
        ]:
            self.planes.pop(key).release()
            self.drawn.pop(key, None)
            self.plane_ms.pop(key, None)
        for slot in [s for s in self.pictures if not self._is_used(s, slots) or self.materials.view == "base"]:
            self.pictures.pop(slot).release()
            self.drawn_pictures.pop(slot, None)
            self.picture_ms.pop(slot, None)

        for slot in [s for s in self.means if not self._is_used(s, slots)]:
            self._release_mean(slot)

    def release_means(self) -> None:
        """Show what is drawn from the visibility buffer here alone."""
        for slot in list(self.means):
            self._release_mean(slot)

    def _release_mean(self, slot: Slot) -> None:
        target = self.means.pop(slot).target
        if target is not None:
            target.release()

    @staticmethod
    def _is_used(slot: Slot, slots: Sequence[Slot]) -> bool:
        return slot in slots or slot.source == REFERENCE

    def release_inputs(self) -> None:
        """Free all but the composite."""
        self.visibility.release()
        self.release_means()
        for target in (*self.planes.values(), *self.pictures.values()):
            target.release()
