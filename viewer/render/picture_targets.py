"""Everything on the GPU that has the size of the picture, and what it was drawn from."""

from dataclasses import dataclass, field, replace

from viewer.render.frame_result import PairKey
from viewer.render.passes.composite import CompositeTarget
from viewer.render.resources.albedo_target import AlbedoTarget
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.render.resources.visibility_buffer import SurfaceContent, VisibilityInputs, VisibilityTarget
from viewer.state.view_state import REFERENCE, Slot, ViewState, is_image_source


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
class DrawnAlbedo:
    """What the albedo of a slot was made from."""

    inputs: VisibilityInputs
    version: int
    """Of the slot's pack; 0 for images."""
    number: int
    """Of the drawing: differs whenever the content may."""


@dataclass
class PictureTargets:
    """Targets of one picture size."""

    visibility: VisibilityTarget
    composite: CompositeTarget
    inputs: VisibilityInputs | None = None
    """Of the last view, with its anisotropy; None before the first."""
    albedo: dict[Slot, AlbedoTarget] = field(default_factory=dict)
    drawn: dict[Slot, DrawnAlbedo] = field(default_factory=dict)
    """Of each albedo that is whole."""
    slot_ms: dict[Slot, float] = field(default_factory=dict)
    """Time that each albedo took when it was last drawn."""

    def inputs_of(self, slot: Slot) -> VisibilityInputs:
        """What the slot's albedo is drawn from: only images and path `cached` filter anisotropically."""
        if self.inputs is None:
            raise RuntimeError("draw the visibility buffer first")
        filters = is_image_source(slot.source) or slot.path == "cached"
        return self.inputs if filters else replace(self.inputs, anisotropy=1)

    def number(self, slot: Slot) -> int:
        """Number of the slot's drawing; 0 where there is none."""
        return self.drawn[slot].number if slot in self.drawn else 0

    def pair_key(self, view: ViewState) -> PairKey:
        """Stands for the content of both slots."""
        return PairKey(view.slot_a, view.slot_b, (self.number(view.slot_a), self.number(view.slot_b)))

    def release_unused(self, view: ViewState) -> None:
        """Free the albedos of all but slots A and B and the reference."""
        for slot in [s for s in self.albedo if s not in (view.slot_a, view.slot_b) and s.source != REFERENCE]:
            self.albedo.pop(slot).release()
            self.drawn.pop(slot, None)
            self.slot_ms.pop(slot, None)

    def release_inputs(self) -> None:
        """Free all but the composite."""
        self.visibility.release()
        for target in self.albedo.values():
            target.release()
