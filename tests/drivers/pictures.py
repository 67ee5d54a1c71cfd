"""Small pictures of the built-in scene by every decode path, for comparing drivers.

`python -m tests.drivers.pictures FOLDER` draws them all with the driver at hand.
"""

import os
import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.mips import linear_to_srgb8
from tests.golden.pictures import GRID, SMALL_CAMERAS, SMALL_SIZE, Studio
from viewer.scene.images import write_png
from viewer.state.view_state import EXACT_PATHS, MaterialView, Slot, ViewState

SLOTS = (
    Slot(),
    *(Slot(pack, path) for pack in ("clustered", GRID) for path in EXACT_PATHS),
    Slot("baseline", "binned"),
    Slot(GRID, "deferred", "fp16"),
    Slot(GRID, "deferred", filter="stochastic"),
)
VIEWS: tuple[MaterialView, ...] = ("base", "lit")


@dataclass(frozen=True)
class DriverPicture:
    """One picture."""

    camera: str
    slot: Slot
    view: MaterialView

    @property
    def name(self) -> str:
        """Of its file."""
        slot = self.slot
        return f"{self.camera}.{slot.source}-{slot.path}-{slot.precision}-{slot.filter}-{self.view}.png"

    def draw(self, studio: Studio) -> NDArray[np.uint8]:
        """[H, W, 3] sRGB, whole."""
        camera = next(camera for camera in studio.scene.cameras if camera.name == self.camera)
        studio.renderer.render(ViewState(camera, SMALL_SIZE, self.slot, material_view=self.view), whole=True)
        return linear_to_srgb8(studio.renderer.picture(self.slot))


ALL_VARIABLE = "NTC_VIEWER_ALL_PICTURES"
"""Environment variable: set, every slot is drawn in every view by every camera."""
SOME = tuple(zip(VIEWS, SMALL_CAMERAS, strict=True))
"""Each view, and each camera, once."""
PICTURES = tuple(
    DriverPicture(camera, slot, view)
    for slot in SLOTS
    for view, camera in (product(VIEWS, SMALL_CAMERAS) if ALL_VARIABLE in os.environ else SOME)
)


def main() -> None:
    """Draw all."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    studio = Studio()
    for picture in PICTURES:
        write_png(folder / picture.name, picture.draw(studio))
    studio.release()


if __name__ == "__main__":
    main()
