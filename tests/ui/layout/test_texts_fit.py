"""No text of a panel is cut or drawn over another one: at every scale, in both themes."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui

from ntc.codec.model import Pack
from tests.support.driven_app import DrivenApp
from tests.support.text_extents import TextExtents
from tests.ui.conftest import Opener
from viewer.inspect.comparison import Comparison, ErrorRow, LiveFigures
from viewer.state.event_handlers import notify

WINDOWS = [((1280, 720), 1.0), ((1280, 720), 1.5), ((1280, 720), 2.0), ((1600, 900), 1.5)]
FIGURES = LiveFigures(
    Comparison(
        pixels=123456,
        psnr_db=31.59,
        ssim=0.9876,
        flip=0.0123,
        flip_map=None,
        problem="",
        histogram=np.full((3, 256), 480, np.int64),
        textures=(ErrorRow(0, 0, 123456, 27.31, 18.20, 12.34, 255), ErrorRow(1, 1, 45678, 31.59, 8.20, 2.34, 128)),
        decoders=(ErrorRow(0, 0, 123456, 27.31, 18.20, 12.34, 255), ErrorRow(1, 1, 45678, 31.59, 8.20, 2.34, 128)),
        ssimulacra2=91.2,
        jod=9.87,
    ),
    is_current=True,
)


@pytest.fixture(params=["packs", "no pack"])
def content(request: pytest.FixtureRequest) -> str:
    """What is open."""
    return str(request.param)


@pytest.fixture(params=WINDOWS, ids=lambda window: f"{window[0][0]}x{window[0][1]} at {window[1]:g}")
def opened(request: pytest.FixtureRequest, content: str, open_window: Opener) -> DrivenApp:
    size, scale = request.param
    packs: dict[str, Pack] | None = None if content == "packs" else {}
    app = open_window(size, packs=packs, live_figures=False, column_folded=False, ui_scale=scale)
    # Nobody looks at the picture.
    app.session.resolution = 0.25
    facts = app.frontend.facts
    app.frontend.facts = lambda: replace(facts(), live=FIGURES)  # type: ignore[method-assign]
    notify(app.session, "it broke at a place with a very long name, and this line goes on and on", "error", "why")
    app.session.window.toasts = ()
    if packs is None:
        app.run("slot.source", "b", "single")
        app.run("overlay.kind", "divergence")
        app.run("compare.measure")
        app.run("compare.mode", "difference")
        app.run("pixel.keep", size[0] // 4, size[1] // 4)
    app.settle()
    return app


def problems(app: DrivenApp, title: str) -> Mapping[str, list[str]]:
    """What is wrong with the texts of a panel, and of each of its inner tabs, by where."""
    found = {}
    app.show_panel(title)
    tabs = [label for label in app.widgets.labels() if label.startswith("tab ")]
    for tab in tabs or [""]:
        if tab:
            app.click(tab)
        with pytest.MonkeyPatch.context() as patch:
            extents = TextExtents(patch)
            app.frame()
        found[f"{title} {tab}"] = extents.problems()
    return {where: wrong for where, wrong in found.items() if wrong}


def tab_problems(app: DrivenApp) -> list[str]:
    """Tabs of panels that are narrower than their titles."""
    wrong = []
    for title in app.frontend.interface.panel_titles:
        window = imgui.internal.find_window_by_name(title)
        if window is not None and window.was_active and window.dock_node is not None:
            bar = window.dock_node.tab_bar
            tab = next(t for t in (bar.tabs[i] for i in range(bar.tabs.size())) if t.id_ == window.tab_id)
            if tab.width < tab.content_width - 1.0:
                wrong.append(f"tab {title}: {tab.width:.0f} of {tab.content_width:.0f}")
    return wrong


def test_every_text_of_every_panel_fits(opened: DrivenApp, content: str) -> None:
    wrong: dict[str, list[str]] = {}
    if content == "no pack":
        wrong["tabs"] = tab_problems(opened)
    for title in opened.frontend.interface.panel_titles:
        wrong |= problems(opened, title)
    wrong = {where: lines for where, lines in wrong.items() if lines}
    assert not wrong, "\n".join(f"{where}: {line}" for where, lines in wrong.items() for line in lines)
