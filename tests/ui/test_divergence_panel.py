"""The divergence map in the window: settings, figures, the block under the mouse, the magnifying glass, recorded paths."""

from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui

from tests.support.driven_app import DrivenApp
from tests.ui.conftest import SIZE
from viewer.app import frontend
from viewer.render.viewport import Viewport
from viewer.state.view_state import WHOLE, Overlay, Slot
from viewer.ui.annotations import slot_note

MEETING = (SIZE[0] / 2, SIZE[1] / 2)
"""Where the two squares meet, as `mapped` looks at them."""


@pytest.fixture
def mapped(app: DrivenApp) -> DrivenApp:
    """Both squares seen from the front, with the map."""
    camera = replace(app.session.view.camera, eye=(0.03, 0.0, 1.5), target=(0.03, 0.0, 0.0))
    app.session.settings = replace(app.session.settings, coarse_while_moving=False)
    app.session.view = replace(
        app.session.view,
        camera=camera,
        compare="a",
        slot_b=Slot("single"),
        overlay=Overlay("divergence"),
    )
    app.settle()
    return app


def labels(app: DrivenApp) -> tuple[str, ...]:
    return app.widgets.labels()


def wheel(app: DrivenApp, at: tuple[float, float], notches: int) -> None:
    app.move(*at)
    for key in (imgui.Key.left_ctrl, imgui.Key.mod_ctrl):
        app.key(key, True)
    for _ in range(abs(notches)):
        imgui.get_io().add_mouse_wheel_event(0.0, 1.0 if notches > 0 else -1.0)
        app.frame()
    for key in (imgui.Key.left_ctrl, imgui.Key.mod_ctrl):
        app.key(key, False)
    app.settle()


def test_a_widget_is_explained_and_grey_with_the_reason(mapped: DrivenApp, monkeypatch: pytest.MonkeyPatch) -> None:
    about = mapped.widgets.tips["block"]
    assert about.startswith("Shape of the blocks")
    assert about.endswith("Key: B")
    monkeypatch.setattr(frontend, "why_not", lambda _context, _command_id: "the map is locked")
    mapped.settle()
    assert mapped.widgets.tips["block"] == f"{about}\nNot now: the map is locked"
    mapped.click("block")
    assert "block: 8x4" not in labels(mapped)
    left, top, right, bottom = mapped.widgets.rectangle("opacity")
    mapped.drag((left + 5, (top + bottom) / 2), (right - 5, (top + bottom) / 2))
    assert mapped.session.view.overlay == Overlay("divergence")


def test_the_map_is_opaque_titled_and_its_scale_does_not_depend_on_the_other_slot(mapped: DrivenApp) -> None:
    overlay = mapped.session.view.overlay
    assert (overlay.opacity, overlay.palette, overlay.scale) == (1.0, "viridis", "block")
    assert "map legend" in labels(mapped)
    assert overlay.legend(2) == overlay.legend(40) == ("1", "2", "3", "4", "5", "6", "7", "8+")
    assert replace(overlay, block="4x4").legend(2)[-1] == "4+"
    assert replace(overlay, scale="picture").legend(3) == ("1", "2", "3")
    mapped.session.window.show_panels = False
    mapped.session.view = replace(mapped.session.view, compare="wipe")
    mapped.settle()
    # Left of the divider, and clear of the legend and the labels.
    rows, columns = slice(60, SIZE[1] // 2), slice(20, SIZE[0] // 2 - 20)
    before = mapped.screenshot()[rows, columns]
    mapped.run("slot.source", "b", "reference")
    mapped.settle()
    np.testing.assert_array_equal(mapped.screenshot()[rows, columns], before)
    view, facts = mapped.session.view, mapped.frontend.facts()
    assert slot_note(view.slot_b, view, facts) == "images have no decoders: no map here"
    assert slot_note(view.slot_a, view, facts) == ""
    mapped.press(imgui.Key.o)
    assert "map legend" not in labels(mapped)


def test_while_moving_blocks_are_as_large_as_at_rest_and_figures_stay(
    mapped: DrivenApp, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_rest = mapped.frontend.facts()
    assert not at_rest.is_preview
    monkeypatch.setattr(Viewport, "is_coarse", lambda _: True)
    camera = mapped.session.view.camera
    mapped.session.view = replace(mapped.session.view, camera=replace(camera, eye=(0.04, 0.0, 1.5)))
    mapped.frame(2)
    view, facts = mapped.frontend.picture.last_view, mapped.frontend.facts()
    assert view is not None
    assert facts.is_preview
    assert view.coarseness * view.block[0] == 8
    assert (view.coarseness * view.size[0]) == pytest.approx(mapped.session.window.picture_size[0], abs=2)
    assert facts.divergence == at_rest.divergence
    assert facts.block is None
    monkeypatch.undo()
    mapped.settle()
    assert not mapped.frontend.facts().is_preview


def test_a_click_keeps_the_block_and_lets_it_go(mapped: DrivenApp) -> None:
    mapped.session.window.show_panels = False
    mapped.click_at(MEETING[0] - 20, MEETING[1] + 60)
    mapped.session.window.show_panels = True
    kept = mapped.session.inspection.block
    assert kept is not None
    mapped.move(5, SIZE[1] - 5)
    mapped.settle()
    block = mapped.frontend.facts().block
    assert block is not None
    # It is the place that is kept: panels leave less room to the picture, which has other blocks.
    assert block.place.column == int(kept[0] * mapped.session.window.picture_size[0]) // 8
    assert f"block texture {block.textures[0].texture_id}" in labels(mapped)
    mapped.click("release")
    assert mapped.session.inspection.block is None


def test_the_magnifying_glass_shows_pixels_and_a_grid(mapped: DrivenApp) -> None:
    mapped.session.window.show_panels = False
    mapped.settle()
    whole = mapped.screenshot()
    camera = mapped.session.view.camera
    wheel(mapped, MEETING, 10)
    assert mapped.session.view.zoom.factor == pytest.approx(1.25**10)
    assert mapped.session.view.camera == camera
    large = mapped.screenshot()
    assert np.abs(large.astype(int) - whole.astype(int)).max() > 50
    # Edges of blocks are darker lines over the whole height.
    middle = large[SIZE[1] // 2 - 60 : SIZE[1] // 2 - 50].astype(int).sum(axis=2).mean(axis=0)
    darker = np.nonzero((middle[1:-1] < middle[:-2] - 40) & (middle[1:-1] < middle[2:] - 40))[0]
    assert len(darker) >= 3
    gaps = np.diff(darker)
    assert np.median(gaps) == pytest.approx(8 * 1.25**10, rel=0.05)
    mapped.press(imgui.Key.z)
    assert mapped.session.view.zoom == WHOLE
