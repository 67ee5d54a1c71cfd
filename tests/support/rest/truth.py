"""Expected content of a window at rest: the same view, drawn whole by `render` in a context without a window."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from ntc.codec.model import Pack
from ntc.codec.quality import psnr_db
from ntc.pack.file import read_pack
from tests.support.rest.plan import USUAL, Budgets, small_budgets
from tests.support.rest.records import Rest, share_equal
from viewer.gl.context import create_headless_context
from viewer.inspect.live_comparison import LiveComparison
from viewer.locations import builtin_scene_path
from viewer.render.frames import read_picture
from viewer.render.renderer import Renderer
from viewer.render.resources.tile_cache.budget import TileCacheConfig
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.state.view_state import NO_OVERLAY, REFERENCE, Slot, ViewState

LEAST_SHARE = 0.999
"""Share of the pixels that must be equal within 1/255."""
COMPARING_SECONDS = 60.0
BESIDE_DIVIDER = 4
"""Number of pixels."""


@dataclass(frozen=True)
class Verdict:
    """Comparison of a window at rest with the picture of `render`."""

    case: str
    share: float
    """Share of the picture's pixels that are equal within 1/255."""
    on_screen: float
    """Share of the screen's pixels beside the user interface that equal the window's picture."""
    psnr_db: float
    """PSNR in dB of the window's picture against `render`; infinite where they are equal."""
    shown_db: float | None
    """PSNR of slot A in the window against the original images, over the covered pixels that show it; None where none do."""
    rendered_db: float | None
    """PSNR of slot A in the picture of `render` against the original images."""

    @property
    def is_right(self) -> bool:
        """Return whether the window rests on the right picture, and has shown it."""
        return self.share >= LEAST_SHARE and self.on_screen >= LEAST_SHARE

    def __str__(self) -> str:
        against = (
            ""
            if self.shown_db is None or self.rendered_db is None
            else f"; slot A {self.shown_db:.2f} dB, by render {self.rendered_db:.2f} dB"
        )
        return (
            f"{self.case}: {100 * self.share:.2f} % of the pixels equal, PSNR {self.psnr_db:.2f} dB against render{against}"
            f"; on screen {100 * self.on_screen:.2f} %"
        )


class Truth:
    """Renderers for the scenes and packs of windows, in a separate context. All calls belong to one thread."""

    def __init__(self) -> None:
        self._context = create_headless_context()
        self._scenes: dict[Path, Scene] = {}
        self._packs: dict[bytes, Pack] = {}
        self._drawn: tuple[object, Renderer] | None = None
        """The last renderer, with what it is of."""

    def __enter__(self) -> "Truth":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._release()
        self._context.gl.release()

    def _release(self) -> None:
        if self._drawn is not None:
            self._drawn[1].release()
        self._drawn = None

    def _scene(self, path: Path | None) -> Scene:
        path = path or builtin_scene_path()
        if path not in self._scenes:
            self._scenes[path] = load_scene(path)
        return self._scenes[path]

    def _pack(self, path: Path) -> Pack:
        content = path.read_bytes()
        if content not in self._packs:
            self._packs[content] = read_pack(path)
        return self._packs[content]

    def _renderer(self, rest: Rest, budgets: Budgets) -> tuple[Renderer, Mapping[str, Pack]]:
        packs = {name: self._pack(path) for name, path in rest.packs.items()}
        key = (rest.scene, budgets, tuple((name, id(pack)) for name, pack in packs.items()))
        # Where memory is short, resident data depends on earlier frames.
        if self._drawn is None or self._drawn[0] != key or budgets != USUAL:
            self._release()
            with small_budgets(budgets):
                tiles = TileCacheConfig(budgets.tile_megabytes << 20) if budgets.tile_megabytes is not None else None
                renderer = Renderer(self._context, self._scene(rest.scene), tile_cache=tiles)
                renderer.set_packs(packs)
            self._drawn = key, renderer
        return self._drawn[1], packs

    def picture(self, rest: Rest, budgets: Budgets = USUAL) -> NDArray[np.uint8]:
        """[H, W, 3] sRGB, row 0 on top: what the window must show."""
        renderer, packs = self._renderer(rest, budgets)
        view = known_paths(rest)
        with small_budgets(budgets):
            frame = renderer.render(view, whole=True)
            if needs_comparison(view):
                compare_all(renderer, view, packs)
                frame = renderer.render(view, whole=True)
        return read_picture(frame.image)

    def verdict(self, rest: Rest, budgets: Budgets = USUAL, quality: bool = True) -> Verdict:
        """Return the comparison of the window with its expected content, with PSNR against the original images if `quality`."""
        right = self.picture(rest, budgets)
        shown_db, rendered_db = self._quality(rest, budgets, right) if quality else (None, None)
        same_size = right.shape == rest.image.shape
        psnr = psnr_db(rest.image, right) if same_size else 0.0
        return Verdict(rest.name, share_equal(rest.image, right), rest.screen_agrees, psnr, shown_db, rendered_db)

    def _quality(self, rest: Rest, budgets: Budgets, right: NDArray[np.uint8]) -> tuple[float | None, float | None]:
        view = rest.view
        plain = view.overlay.kind == "none" and not view.highlight and view.slot_a.source != REFERENCE
        if view.compare not in ("a", "wipe") or not plain or right.shape != rest.image.shape:
            return None, None
        renderer, _ = self._renderer(rest, budgets)
        with small_budgets(budgets):
            original = replace(view, slot_a=Slot(REFERENCE), slot_b=Slot(REFERENCE), compare="a", overlay=NO_OVERLAY)
            reference = read_picture(renderer.render(original, whole=True).image)
        pixels = renderer.covered()
        if view.compare == "wipe":
            pixels = pixels & (np.arange(view.size[0]) < view.wipe_position * view.size[0] - BESIDE_DIVIDER)
        if not pixels.any():
            return None, None
        return psnr_db(rest.image[pixels], reference[pixels]), psnr_db(right[pixels], reference[pixels])

    def figure(self, rest: Rest) -> float:
        """PSNR in dB of slot A against slot B over the covered pixels, as panels give it."""
        renderer, _ = self._renderer(rest, USUAL)
        view = replace(known_paths(rest), overlay=NO_OVERLAY)
        a, b = (read_picture(renderer.render(replace(view, compare=side), whole=True).image) for side in ("a", "b"))
        covered = renderer.covered()
        return psnr_db(a[covered], b[covered])


def known_paths(rest: Rest) -> ViewState:
    """The view of a window, with the path that `auto` chose there: another choice is another arithmetic."""
    view = rest.view
    slots = {side: replace(slot, path=rest.paths.get(slot, slot.path)) for side, slot in view.slots.items()}
    return replace(view, slot_a=slots["a"], slot_b=slots["b"])


def needs_comparison(view: ViewState) -> bool:
    """Return whether the picture shows results of a comparison of A and B."""
    is_flip = view.compare == "difference" and view.difference.kind == "flip"
    return is_flip or view.overlay.kind in ("error-texture", "error-decoder")


def compare_all(renderer: Renderer, view: ViewState, packs: Mapping[str, Pack]) -> None:
    """Compare A with B as a window does, and wait for it."""
    live, end = LiveComparison(), time.monotonic() + COMPARING_SECONDS
    try:
        while live.figures.comparison is None:
            now = time.monotonic()
            if live.figures.problem or now > end:
                raise RuntimeError(f"no comparison: {live.figures.problem or 'it takes too long'}")
            live.note(renderer, view, packs, view.size, now)
            live.step(view, True, now)
            time.sleep(0.01)
    finally:
        live.close()
