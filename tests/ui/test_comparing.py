"""Comparing A with B in the window: modes, flicker, dividers, live figures, one pixel, errors."""

import itertools
import math
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui

from ntc.codec.mips import linear_to_srgb8
from ntc.codec.quality import psnr_db
from tests.support.driven_app import DrivenApp
from tests.ui.conftest import SIZE, Opener
from viewer.commands import run_line
from viewer.render.renderer import Renderer
from viewer.state.view_state import CompareMode, Slot

MIDDLE = (SIZE[0] / 2, SIZE[1] / 2)


@pytest.fixture
def live(open_window: Opener) -> Iterator[DrivenApp]:
    """With live figures; the camera looks at both squares from the front."""
    made = open_window(coarse_while_moving=False, column_folded=False)
    camera = replace(made.session.view.camera, eye=(0.03, 0.0, 1.5), target=(0.03, 0.0, 0.0))
    made.session.view = replace(made.session.view, camera=camera)
    made.settle()
    yield made
    made.until(lambda: not made.frontend.live.is_computing)


def labels(app: DrivenApp) -> tuple[str, ...]:
    return app.widgets.labels()


def hide_panels(app: DrivenApp) -> None:
    app.session.window.show_panels = False
    app.settle()


@pytest.mark.parametrize("mode", ["a", "wipe", "difference"])
def test_space_shows_the_other_slot_in_every_mode(app: DrivenApp, mode: CompareMode) -> None:
    hide_panels(app)
    view = replace(app.session.view, compare=mode)
    app.session.view = view
    app.settle()
    before = app.screenshot()
    app.key(imgui.Key.space, True)
    app.settle()
    held = app.screenshot()
    swapped: CompareMode = {"a": "b", "b": "a", "difference": "b"}.get(mode, mode)  # type: ignore[assignment]
    other = replace(view, compare=swapped)
    if mode not in ("a", "b", "difference"):
        other = replace(other, slot_a=view.slot_b, slot_b=view.slot_a)
    app.key(imgui.Key.space, False)
    app.settle()
    np.testing.assert_array_equal(app.screenshot(), before)
    app.session.view = other
    app.settle()
    # Labels say which slot is where and keep its letter.
    rows = slice(60, SIZE[1] // 2 - 40)
    np.testing.assert_array_equal(held[rows], app.screenshot()[rows])
    assert (held != before).any()


def test_flicker_composes_and_decodes_nothing(app: DrivenApp, monkeypatch: pytest.MonkeyPatch) -> None:
    hide_panels(app)
    for mode in ("a", "b", "a"):
        run_line(app.context, f"compare.mode {mode}")
        app.settle()
    passes: list[tuple[str, ...]] = []
    render = Renderer.render

    def counted(self: Renderer, *arguments: object) -> object:
        frame = render(self, *arguments)  # type: ignore[arg-type]
        passes.append(tuple(frame.timings_ms))
        return frame

    monkeypatch.setattr(Renderer, "render", counted)
    now = [1000.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    run_line(app.context, "compare.flicker 4")
    shown = []
    for _ in range(16):
        now[0] += 1.0 / 16.0
        assert 0.0 <= app.frontend.seconds_until_change <= 0.125
        app.frame()
        shown.append(app.session.shown_view.compare)
    # Both four times a second.
    assert sum(first != second for first, second in itertools.pairwise(shown)) in (7, 8)
    assert set(shown) == {"a", "b"}
    assert set(passes) == {("composite",)}
    assert len(passes) in (7, 8)
    run_line(app.context, "compare.flicker 0")
    app.frame()
    assert app.session.shown_view.compare == "a"
    assert app.frontend.seconds_until_change == math.inf


def test_figures_of_the_view_come_when_it_rests(live: DrivenApp) -> None:
    live.until(lambda: live.frontend.facts().live.is_current)
    found = live.frontend.facts().live.comparison
    renderer = live.frontend.picture.renderer
    assert found is not None
    assert renderer is not None
    covered = renderer.covered()
    a, b = (linear_to_srgb8(renderer.picture(slot))[covered] for slot in (live.session.view.slot_a, Slot()))
    assert found.psnr_db == pytest.approx(psnr_db(a, b), abs=0.01)
    assert found.pixels == covered.sum()
    assert found.ssim is not None
    assert found.flip is not None
    assert -1.0 < found.ssim < 1.0
    assert 0.0 < found.flip < 1.0
    assert (found.histogram.sum(axis=1) == found.pixels).all()
    ids = renderer.texture_ids()[covered]
    for row in found.textures:
        assert row.pixels == (ids == row.number).sum()
        assert row.psnr_db == pytest.approx(psnr_db(a[ids == row.number], b[ids == row.number]), abs=0.01)
        difference = np.abs(a.astype(int) - b)[ids == row.number]
        assert row.mean == pytest.approx(difference.mean())
        assert row.largest == difference.max()
    assert sum(row.pixels for row in found.decoders) == sum(row.pixels for row in found.textures)
    # Other modes are of the same picture.
    for mode in ("a", "b", "side-by-side", "difference"):
        run_line(live.context, f"compare.mode {mode}")
        live.settle()
        assert live.frontend.facts().live.comparison is found
        assert live.frontend.facts().live.is_current
        assert not live.frontend.live.is_computing


def test_nothing_is_computed_while_the_camera_moves_and_stale_figures_are_dropped(live: DrivenApp) -> None:
    started = time.monotonic()
    number = 0
    while time.monotonic() - started < 0.8:
        number += 1
        camera = replace(live.session.view.camera, eye=(0.001 * number, 0.0, 1.5))
        live.session.view = replace(live.session.view, camera=camera)
        live.frame()
        assert not live.frontend.live.is_computing
    live.until(lambda: live.frontend.live.is_computing)
    live.session.view = replace(live.session.view, camera=replace(live.session.view.camera, eye=(0.2, 0.0, 1.5)))
    live.frame()
    figures = live.frontend.facts().live
    assert figures.comparison is None
    assert not figures.is_current
    live.until(lambda: live.frontend.facts().live.is_current)
    found = live.frontend.facts().live.comparison
    renderer = live.frontend.picture.renderer
    assert found is not None
    assert renderer is not None
    assert found.pixels == renderer.covered().sum()


def test_the_errors_are_sorted_coloured_and_highlighted(live: DrivenApp) -> None:
    live.until(lambda: live.frontend.facts().live.is_current)
    live.click("show histogram")
    assert "histogram" in labels(live)
    run_line(live.context, "histogram.panel")
    live.show_panel("Compare")
    live.click("show errors")
    found = live.frontend.facts().live.comparison
    assert found is not None
    worst = min(found.textures, key=lambda row: row.psnr_db).number
    listed = [label for label in labels(live) if label.startswith("error texture ")]
    assert listed[0] == f"error texture {worst}"
    assert len(listed) == len(found.textures) == 2
    live.click("sort by psnr")
    assert [label for label in labels(live) if label.startswith("error texture ")] == listed[::-1]
    run_line(live.context, "errors.sort mean")
    assert (live.session.inspection.errors.column, live.session.inspection.errors.descending) == ("mean", True)
    live.settle()
    live.click(f"error texture {worst}")
    assert live.session.view.highlight == (worst,)
    live.click("end highlight")
    assert live.session.view.highlight == ()
    live.click("errors in the picture")
    assert live.session.view.overlay.kind == "error-texture"
    live.click("errors by decoder")
    live.settle()
    assert live.session.view.overlay.kind == "error-decoder"
    decoder = found.decoders[0].number
    live.click(f"error decoder {decoder}")
    assert len(live.session.view.highlight) == 1
    assert live.session.inspection.errors.highlighted_decoder == decoder


def test_one_pixel_is_read_when_it_or_the_picture_changes(app: DrivenApp) -> None:
    camera = replace(app.session.view.camera, eye=(0.03, 0.0, 1.5), target=(0.03, 0.0, 0.0))
    app.session.settings = replace(app.session.settings, coarse_while_moving=False)
    app.session.view = replace(app.session.view, camera=camera)
    width, height = app.session.window.picture_size
    x, y = round(0.58 * width), round(0.45 * height)
    run_line(app.context, f"pixel.keep {x} {y}")
    app.settle()
    assert "pixel" in labels(app)
    pixel, renderer = app.frontend.facts().pixel, app.frontend.picture.renderer
    assert pixel is not None
    assert renderer is not None
    assert (pixel.place.x, pixel.place.y) == (x, y)
    for slot, patch in ((app.session.view.slot_a, pixel.a), (app.session.view.slot_b, pixel.b)):
        whole = renderer.picture(slot)
        assert patch is not None
        np.testing.assert_array_equal(patch.linear, whole[y - 7 : y + 8, x - 7 : x + 8])
        assert patch.middle[1] == tuple(linear_to_srgb8(whole[y, x]).tolist())
    assert pixel.texture_id == renderer.texture_ids()[y, x]
    assert pixel.decoders["clustered"] == renderer.decoders("clustered")[pixel.texture_id]
    assert pixel.block_decoders["clustered"] >= 1
    assert pixel.lod is not None
    reads = app.frontend.reader.pixels.reads
    app.settle()
    app.move(300.0, 20.0)
    app.settle()
    assert app.frontend.reader.pixels.reads == reads
    app.click("let the pixel go")
    hide_panels(app)
    app.session.window.show_panels = True
    app.move(MIDDLE[0] + 22, SIZE[1] - 60.0)
    app.settle()
    assert app.frontend.reader.pixels.reads > reads


def test_pixels_at_the_edge_and_beside_each_other(app: DrivenApp) -> None:
    run_line(app.context, "pixel.keep 0 0")
    app.settle()
    pixel = app.frontend.facts().pixel
    assert pixel is not None
    assert pixel.place.inside == (7, 7, 15, 15)
    assert pixel.material_name is None
    run_line(app.context, "pixel.let-go")
    run_line(app.context, "compare.mode side-by-side")
    hide_panels(app)
    for x, seen in ((SIZE[0] // 4, 0.5), (SIZE[0] * 3 // 4, 0.5), (SIZE[0] // 2 - 2, 0.75), (SIZE[0] // 2 + 2, 0.25)):
        app.move(float(x), 200.0)
        hovered = app.session.inspection.hovered
        assert hovered is not None
        assert hovered[0] == pytest.approx(seen, abs=0.004)
