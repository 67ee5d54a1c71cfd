"""Which golden pictures there are, and how one is drawn."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.color import linear_to_srgb8
from viewer.cli.sources import builtin_scene_path
from viewer.gl.context import create_headless_context
from viewer.render.frame_result import read_picture
from viewer.render.renderer import Renderer
from viewer.scene.load import load_scene
from viewer.state.pack_files import open_packs, packs_beside
from viewer.state.view_state import REFERENCE, Overlay, Slot, ViewState

SIZE = (320, 180)
FOLDER = Path(__file__).parent / "llvmpipe"
SLOTS = (
    Slot(REFERENCE),
    Slot("clustered", "deferred"),
    Slot("clustered", "forward"),
    Slot("clustered", "binned"),
    Slot("baseline", "deferred"),
)


PLAIN = Overlay()
OVERLAYS = (
    Overlay("divergence"),
    Overlay("divergence", opacity=0.9, palette="viridis", block="16x4"),
)
"""Maps that are compared too, A against B."""


@dataclass(frozen=True)
class GoldenPicture:
    """One picture to compare."""

    camera: str
    slot: Slot
    overlay: Overlay = PLAIN

    @property
    def path(self) -> Path:
        """Where its accepted version lies."""
        if self.overlay.kind != "none":
            return FOLDER / f"{self.camera}.divergence-{self.overlay.palette}-{self.overlay.block}.png"
        way = self.slot.source if self.slot.source == REFERENCE else f"{self.slot.source}-{self.slot.path}"
        return FOLDER / f"{self.camera}.{way}.png"


class Studio:
    """The built-in scene with its packs, ready to draw."""

    def __init__(self) -> None:
        path = builtin_scene_path()
        self.scene = load_scene(path)
        self.context = create_headless_context()
        self.renderer = Renderer(self.context, self.scene)
        self.renderer.set_packs(open_packs(packs_beside(path)))

    def renderer_description(self) -> dict[str, str]:
        """What the comparison depends on: the names of renderer and driver version."""
        return {"renderer": self.context.info.renderer, "version": self.context.info.version}

    def pictures(self) -> tuple[GoldenPicture, ...]:
        """Every camera of the scene in every way of drawing."""
        return tuple(GoldenPicture(camera.name, slot) for camera in self.scene.cameras for slot in SLOTS)

    def maps(self) -> tuple[GoldenPicture, ...]:
        """Divergence maps, clustered against baseline, of two cameras."""
        names = [camera.name for camera in self.scene.cameras][:2]
        return tuple(GoldenPicture(name, SLOTS[1], overlay) for name in names for overlay in OVERLAYS)

    def draw(self, picture: GoldenPicture) -> NDArray[np.uint8]:
        """[H, W, 3] uint8 sRGB."""
        camera = next(camera for camera in self.scene.cameras if camera.name == picture.camera)
        view = ViewState(camera=camera, size=SIZE, slot_a=picture.slot, overlay=picture.overlay)
        if picture.overlay.kind != "none":
            frame = self.renderer.render(replace(view, slot_b=SLOTS[3], compare="wipe"))
            return read_picture(frame.image)
        self.renderer.render(view)
        return linear_to_srgb8(self.renderer.albedo(picture.slot))
