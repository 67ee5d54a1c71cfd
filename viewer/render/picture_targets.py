"""Everything on the GPU that has the size of the picture."""

from dataclasses import dataclass, field

from viewer.render.passes.composite import CompositeTarget
from viewer.render.resources.albedo_target import AlbedoTarget
from viewer.render.resources.visibility_buffer import VisibilityTarget
from viewer.state.view_state import Slot


@dataclass(frozen=True)
class DrawnAlbedo:
    """What an albedo was made from."""

    key: object
    """Equal means that it is still good."""
    seen: object
    """What of it does not depend on the pack."""
    number: int
    """Of the drawing: differs whenever the albedo may."""


@dataclass
class PictureTargets:
    """Everything that has the size of the picture."""

    visibility: VisibilityTarget
    composite: CompositeTarget
    albedo: dict[Slot, AlbedoTarget] = field(default_factory=dict)
    drawn: dict[Slot, DrawnAlbedo] = field(default_factory=dict)
    """For each slot what its albedo was made from."""
    slot_ms: dict[Slot, float] = field(default_factory=dict)
    visibility_key: object = None
    composite_key: object = None

    def release(self) -> None:
        """Free all of it."""
        self.release_all_but_picture()
        self.composite.release()

    def release_all_but_picture(self) -> None:
        """Free what the picture was made from."""
        self.visibility.release()
        for target in self.albedo.values():
            target.release()
