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
    """Where it stands at first, below those before it, or beside all of its side where it floats."""
    height: Callable[[float], float]
    """At first, from the height of the window."""
    draw: Callable[[PanelContext], None]
    shown: Callable[[Session], bool] = lambda _session: True
    folded: Callable[[float], bool] = lambda _height: False
    """At first, from the height of the window."""
    floats: bool = False
    """Whether it takes no room from those of its side: it stands at the lower edge of the window."""


def _scene_height(window: float) -> float:
    """Leaves room below for the panel Divergence."""
    return min(max(window - 600.0, 120.0), 360.0)


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
            lambda window: min(320.0, 0.45 * window),
            lambda c: draw_errors_panel(c.session, c.facts, c.emit, c.items),
            shown=lambda session: session.comparing.errors,
            floats=True,
        ),
        Panel(
            "Pixel",
            "right",
            lambda _: 400.0,
            lambda c: draw_pixel_panel(c.session, c.facts, c.emit, c.items),
            shown=lambda session: session.comparing.pixel,
            floats=True,
        ),
        Panel(
            "Histogram",
            "right",
            lambda _: 230.0,
            lambda c: histogram.draw(c.facts, c.items),
            shown=lambda session: session.comparing.histogram,
            floats=True,
        ),
    )
