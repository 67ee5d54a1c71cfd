"""All panels of the window. A new one is a file of its own and an entry here."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from viewer.session import Session
from viewer.ui.compare_panel import draw_compare_panel
from viewer.ui.divergence_panel import draw_divergence_panel
from viewer.ui.errors_panel import draw_errors_panel
from viewer.ui.facts import Emit, FrameFacts
from viewer.ui.histogram_panel import HistogramPanel
from viewer.ui.items import ItemPlaces
from viewer.ui.pixel_panel import draw_pixel_panel
from viewer.ui.scene_panel import OpenField, draw_scene_panel
from viewer.ui.timings_panel import draw_timings_panel

Side = Literal["left", "right"]
WIDTH = 380.0
EDGE = 8.0
COLUMN = WIDTH + 2.0 * EDGE
"""What the panels of one side take up."""
TOP = 36.0
LOWER_EDGE = 36.0
"""Room for the line of hints."""
PIXEL_HEIGHT = 400.0
HISTOGRAM_HEIGHT = 150.0


@dataclass(frozen=True, eq=False)
class PanelContext:
    """What a panel draws from, and whom it asks."""

    session: Session
    facts: FrameFacts
    emit: Emit
    items: ItemPlaces


@dataclass(frozen=True, eq=False)
class Panel:
    """A window within the window."""

    title: str
    side: Side
    """Where it stands at first, below those before it, unless `place` says otherwise."""
    height: Callable[[float], float]
    """At first, from the height of the window."""
    draw: Callable[[PanelContext], None]
    shown: Callable[[Session], bool] = lambda _session: True
    folded: Callable[[float], bool] = lambda _height: False
    """At first, from the height of the window."""
    place: Callable[[tuple[float, float]], tuple[float, float]] | None = None
    """Left and top at first, from the size of the window: for what is opened now and then and takes no room from others."""


def _scene_height(window: float) -> float:
    """Leaves room below for the panel Divergence."""
    return min(max(window - 600.0, 120.0), 360.0)


def _below_scene(window: float) -> float:
    return TOP + _scene_height(window) + EDGE


def _errors_height(window: float) -> float:
    return min(320.0, 0.45 * window)


def make_panels() -> tuple[Panel, ...]:
    """The panels of one window; those that remember something remember it for this window."""
    open_field, histogram = OpenField(), HistogramPanel()
    return (
        Panel("Compare", "left", lambda _: 470.0, lambda c: draw_compare_panel(c.session, c.facts, c.emit, c.items)),
        Panel(
            "Timings",
            "left",
            lambda _: 270.0,
            lambda c: draw_timings_panel(c.facts),
            folded=lambda height: height < 760.0,
        ),
        Panel("Scene", "right", _scene_height, lambda c: draw_scene_panel(c.session, open_field, c.emit, c.items)),
        Panel(
            "Divergence",
            "right",
            lambda window: max(240.0, window - 36.0 - _scene_height(window) - 48.0),
            lambda c: draw_divergence_panel(c.session, c.facts, c.emit, c.items),
            shown=lambda session: session.view.overlay.kind == "divergence",
        ),
        Panel(
            "Errors",
            "left",
            _errors_height,
            lambda c: draw_errors_panel(c.session, c.facts, c.emit, c.items),
            shown=lambda session: session.comparing.errors,
            place=lambda size: (COLUMN, size[1] - _errors_height(size[1]) - LOWER_EDGE),
        ),
        Panel(
            "Pixel",
            "right",
            lambda _: PIXEL_HEIGHT,
            lambda c: draw_pixel_panel(c.session, c.facts, c.emit, c.items),
            shown=lambda session: session.comparing.pixel,
            place=lambda size: (max(EDGE, size[0] - WIDTH - EDGE), _below_scene(size[1])),
        ),
        Panel(
            "Histogram",
            "left",
            lambda _: HISTOGRAM_HEIGHT,
            lambda c: histogram.draw(c.facts, c.items),
            shown=lambda session: session.comparing.histogram,
            place=lambda size: (EDGE, size[1] - HISTOGRAM_HEIGHT - LOWER_EDGE),
        ),
    )
