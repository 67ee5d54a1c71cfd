"""All panels of the window. A new one is a file of its own and an entry here."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from viewer.session import Session
from viewer.ui.compare_panel import draw_compare_panel
from viewer.ui.divergence_panel import draw_divergence_panel
from viewer.ui.facts import Emit, FrameFacts
from viewer.ui.items import ItemPlaces
from viewer.ui.scene_panel import OpenField, draw_scene_panel
from viewer.ui.timings_panel import draw_timings_panel
from viewer.ui.training_panel import TrainingPanel

Side = Literal["left", "right"]
LEAST_FOR_TRAINING = 500.0
FOLDED = 20.0
"""Height of a panel's title."""


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
    """Where it stands at first, below those before it."""
    height: Callable[[float], float]
    """At first, from the height of the window."""
    draw: Callable[[PanelContext], None]
    shown: Callable[[Session], bool] = lambda _session: True
    folded: Callable[[float], bool] = lambda _height: False
    """At first, from the height of the window."""


def _scene_height(window: float) -> float:
    """Leaves room below for the panel Divergence."""
    return min(max(window - 600.0, 120.0), 360.0)


def _training_height(window: float) -> float:
    """Only its title where there is no room for more."""
    return min(max(window - 400.0, 320.0), 560.0) if window >= LEAST_FOR_TRAINING else FOLDED


def make_panels() -> tuple[Panel, ...]:
    """The panels of one window; those that remember something remember it for this window."""
    open_field, training = OpenField(), TrainingPanel()
    return (
        Panel("Compare", "left", lambda _: 356.0, lambda c: draw_compare_panel(c.session, c.facts, c.emit, c.items)),
        Panel(
            "Timings",
            "left",
            lambda _: 270.0,
            lambda c: draw_timings_panel(c.facts),
            folded=lambda height: height < 640.0,
        ),
        Panel("Scene", "right", _scene_height, lambda c: draw_scene_panel(c.session, open_field, c.emit, c.items)),
        Panel(
            "Training",
            "right",
            _training_height,
            lambda c: training.draw(c.session, c.emit, c.items),
            folded=lambda height: height < LEAST_FOR_TRAINING,
        ),
        Panel(
            "Divergence",
            "right",
            lambda window: max(240.0, window - 36.0 - _scene_height(window) - _training_height(window) - 56.0),
            lambda c: draw_divergence_panel(c.session, c.facts, c.emit, c.items),
            shown=lambda session: session.view.overlay.kind != "none",
        ),
    )
