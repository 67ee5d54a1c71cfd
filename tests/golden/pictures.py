"""Which golden pictures there are, how one is drawn, and how it is compared with its accepted version.

`python -m tests.golden.pictures` draws all of them anew. Look at them before committing.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.mips import linear_to_srgb8
from ntc.io import write_text
from ntc.pack.file import read_pack
from viewer.gl.context import create_headless_context
from viewer.locations import builtin_scene_path
from viewer.render.frames import read_picture
from viewer.render.renderer import Renderer
from viewer.scene.images import read_image, write_png
from viewer.scene.load import load_scene
from viewer.state.pack_files import open_packs, packs_beside
from viewer.state.view_state import REFERENCE, Anisotropy, DecodePath, Overlay, Precision, Slot, ViewState

FOLDER = Path(__file__).parent / "llvmpipe"
FAILED = Path(__file__).parent / "failed"
"""What was drawn in place of an accepted picture, and the difference of the two."""

SIZE = (320, 180)
SMALL_SIZE = (160, 90)
SMALL_CAMERAS = ("entrance", "grazing")

GRID = "grid"
"""What the pack of codec `grid` is called; the packs that ship are of codec `block`."""
GRID_PACK = Path(__file__).parent / "courtyard.grid.ntc"

SLOTS = (
    Slot(REFERENCE),
    Slot("clustered", "deferred"),
    Slot(GRID, "deferred"),
    Slot(GRID, "forward"),
    Slot(GRID, "binned"),
)
"""Drawn from every camera of the scene."""

SMALL_SLOTS = (Slot("clustered", "forward"), Slot("clustered", "binned"), Slot("baseline", "deferred"))
CACHED_SLOTS = (Slot("clustered", "cached"), Slot("baseline", "cached"), Slot(GRID, "cached"))
HALF_PATHS: dict[Precision, tuple[DecodePath, ...]] = {
    "fp16": ("deferred", "forward", "binned", "cached"),
    "fp16-arithmetic": ("deferred", "forward", "binned", "cached"),
    "fp16-accumulate": ("deferred", "forward"),
}
"""Paths of each precision of halves. Emulated halves take llvmpipe long to compile: `fp16-accumulate` has two of them."""

PLAIN = Overlay()
OVERLAYS = (
    Overlay("divergence"),
    Overlay("divergence", opacity=0.6, palette="green-red", block="16x4", scale="picture"),
)
"""Maps that are compared too, A against B."""


@dataclass(frozen=True)
class GoldenPicture:
    """One picture to compare."""

    camera: str
    slot: Slot
    overlay: Overlay = PLAIN
    size: tuple[int, int] = SIZE
    """(width, height) in pixels."""
    anisotropy: Anisotropy = 1

    @property
    def path(self) -> Path:
        """File of its accepted version."""
        if self.overlay.kind != "none":
            return FOLDER / f"{self.camera}.divergence-{self.overlay.palette}-{self.overlay.block}.png"
        parts = [self.slot.source]
        if self.slot.source != REFERENCE:
            parts.append(self.slot.path)
        if self.slot.precision != "fp32":
            parts.append(self.slot.precision)
        if self.anisotropy > 1:
            parts.append(f"anisotropy-{self.anisotropy}")
        return FOLDER / f"{self.camera}.{'-'.join(parts)}.png"

    @property
    def is_filtered_by_driver(self) -> bool:
        """Whether OpenGL leaves open how it is filtered: images, anisotropically. Path `cached` filters by itself."""
        return self.anisotropy > 1 and self.slot.source == REFERENCE

    def share_beyond(self, image: NDArray[np.uint8], tolerance: int) -> float:
        """Share of the pixels of `image` [H, W, 3] sRGB that differ from the accepted ones by more than `tolerance` of 255.

        Where any does, `image` and the difference, amplified so that the largest is white, are kept in FAILED.
        """
        accepted = read_image(self.path)[..., :3]
        difference = np.abs(image.astype(int) - accepted.astype(int))
        share = float((difference.max(axis=-1) > tolerance).mean())
        kept = {"drawn": image, "difference": (difference * 255 // max(1, int(difference.max()))).astype(np.uint8)}
        for kind, pixels in kept.items():
            file = FAILED / f"{self.path.stem}.{kind}.png"
            if share > 0.0:
                FAILED.mkdir(exist_ok=True)
                write_png(file, pixels)
            else:
                file.unlink(missing_ok=True)
        return share


class Studio:
    """The built-in scene with its packs, ready to draw. What the driver lacks of half arithmetic is emulated."""

    def __init__(self) -> None:
        path = builtin_scene_path()
        self.scene = load_scene(path)
        self.context = create_headless_context()
        self.renderer = Renderer(self.context, self.scene, emulate_half=True)
        self.renderer.set_packs({**open_packs(packs_beside(path)), GRID: read_pack(GRID_PACK)})

    def release(self) -> None:
        """Free everything on the GPU."""
        self.renderer.release()
        self.context.gl.release()

    def renderer_description(self) -> dict[str, str]:
        """What the comparison depends on: the names of renderer and driver version."""
        return {"renderer": self.context.info.renderer, "version": self.context.info.version}

    def pictures(self) -> tuple[GoldenPicture, ...]:
        """Every camera of the scene in every fp32 way of drawing that decodes pixels."""
        return tuple(GoldenPicture(camera.name, slot) for camera in self.scene.cameras for slot in SLOTS)

    def maps(self) -> tuple[GoldenPicture, ...]:
        """Divergence maps, clustered against baseline, of two cameras."""
        names = [camera.name for camera in self.scene.cameras][:2]
        return tuple(
            GoldenPicture(name, Slot("clustered", "deferred"), overlay) for name in names for overlay in OVERLAYS
        )

    def cached(self) -> tuple[GoldenPicture, ...]:
        """Path `cached` at a small size, with and without anisotropic filtering."""
        slots = (Slot(REFERENCE), Slot(GRID, "cached"))
        filtered = (GoldenPicture("grazing", slot, PLAIN, SMALL_SIZE, 8) for slot in slots)
        return (*small(CACHED_SLOTS), *filtered)

    def blocks(self) -> tuple[GoldenPicture, ...]:
        """Other paths and groupings of codec `block`, at a small size."""
        return small(SMALL_SLOTS)

    def halves(self, precision: Precision) -> tuple[GoldenPicture, ...]:
        """Decode paths in a precision of halves, at a small size."""
        return small(Slot(GRID, path, precision) for path in HALF_PATHS[precision])

    def all_pictures(self) -> tuple[GoldenPicture, ...]:
        """All of them."""
        halves = (picture for precision in HALF_PATHS for picture in self.halves(precision))
        return (*self.pictures(), *self.maps(), *self.cached(), *self.blocks(), *halves)

    def draw(self, picture: GoldenPicture) -> NDArray[np.uint8]:
        """[H, W, 3] uint8 sRGB."""
        camera = next(camera for camera in self.scene.cameras if camera.name == picture.camera)
        view = ViewState(
            camera=camera,
            size=picture.size,
            slot_a=picture.slot,
            overlay=picture.overlay,
            anisotropy=picture.anisotropy,
        )
        if picture.overlay.kind != "none":
            frame = self.renderer.render(replace(view, slot_b=Slot("baseline", "deferred"), compare="wipe"))
            return read_picture(frame.image)
        self.renderer.render(view, whole=True)
        return linear_to_srgb8(self.renderer.picture(picture.slot))


def small(slots: Iterable[Slot]) -> tuple[GoldenPicture, ...]:
    """`slots` from the few cameras that small pictures are drawn from."""
    return tuple(GoldenPicture(camera, slot, size=SMALL_SIZE) for slot in slots for camera in SMALL_CAMERAS)


def main() -> None:
    """Replace the accepted pictures by new ones."""
    studio = Studio()
    wanted = {picture.path: picture for picture in studio.all_pictures()}
    for old in FOLDER.glob("*.png"):
        if old not in wanted:
            old.unlink()
    for picture in wanted.values():
        image = studio.draw(picture)
        # What looks as before keeps its file.
        if not picture.path.is_file() or picture.share_beyond(image, 0) > 0.0:
            write_png(picture.path, image)
    write_text(FOLDER / "renderer.json", json.dumps(studio.renderer_description(), indent=2) + "\n")


if __name__ == "__main__":
    main()
