"""All panels of the window. A new one is a file of its own and an entry here."""

from collections.abc import Callable
from dataclasses import dataclass

from viewer.jobs.background import Background
from viewer.state.session import Session
from viewer.training.live_training import LiveTraining
from viewer.ui.compare_panel import draw_compare_panel
from viewer.ui.divergence_panel import draw_divergence_panel
from viewer.ui.dock_layout import Place
from viewer.ui.errors_panel import draw_errors_panel
from viewer.ui.facts import Emit, FrameFacts
from viewer.ui.groups_panel import GroupsPanel
from viewer.ui.histogram_panel import HistogramPanel
from viewer.ui.log_panel import LogPanel
from viewer.ui.memory_panel import MemoryPanel
from viewer.ui.pixel_panel import draw_pixel_panel
from viewer.ui.scene_panel import OpenField, draw_scene_panel
from viewer.ui.scene_tree_list import SceneLists
from viewer.ui.textures_panel import TexturesPanel
from viewer.ui.timings_panel import draw_timings_panel
from viewer.ui.timings_plot import TimingsPlot
from viewer.ui.training_panel import TrainingPanel
from viewer.ui.widgets import WidgetRects


@dataclass(frozen=True, eq=False)
class PanelContext:
    """What a panel draws from, and whom it asks."""

    session: Session
    training: LiveTraining
    facts: FrameFacts
    emit: Emit
    items: WidgetRects


@dataclass(frozen=True, eq=False)
class Panel:
    """A window within the window."""

    title: str
    side: Place
    """Where it is docked at first; panels of one place are tabs, the first in front."""
    height: Callable[[float], float]
    """At first, from the height of the window; of a place that shares its column, the first panel's counts."""
    draw: Callable[[PanelContext], None]
    shown: Callable[[Session], bool] = lambda _session: True


def _scene_height(window: float) -> float:
    """Leaves room below for the panel Divergence."""
    return min(max(window - 430.0, 120.0), 560.0)


def make_panels(background: Background) -> tuple[Panel, ...]:
    """The panels of one window; those that remember something remember it for this window."""
    open_field, lists, plot, histogram = OpenField(), SceneLists(), TimingsPlot(), HistogramPanel()
    textures, groups, memory, log = TexturesPanel(), GroupsPanel(background), MemoryPanel(), LogPanel()
    training = TrainingPanel()
    return (
        Panel("Compare", "left", lambda _: 440.0, lambda c: draw_compare_panel(c.session, c.facts, c.emit, c.items)),
        Panel("Timings", "left below", lambda _: 300.0, lambda c: draw_timings_panel(c.facts, plot, c.items)),
        Panel("Memory", "left below", lambda _: 300.0, lambda c: memory.draw(c.session, c.facts, c.items)),
        Panel(
            "Scene", "right", _scene_height, lambda c: draw_scene_panel(c.session, open_field, lists, c.emit, c.items)
        ),
        Panel("Textures", "right", _scene_height, lambda c: textures.draw(c.session, c.facts, c.emit, c.items)),
        Panel("Groups", "right", _scene_height, lambda c: groups.draw(c.session, c.facts, c.emit, c.items)),
        Panel("Training", "right", _scene_height, lambda c: training.draw(c.session, c.training, c.emit, c.items)),
        Panel(
            "Divergence",
            "right below",
            lambda window: max(240.0, window - _scene_height(window)),
            lambda c: draw_divergence_panel(c.session, c.facts, c.emit, c.items),
            shown=lambda session: session.view.overlay.kind == "divergence",
        ),
        Panel(
            "Pixel",
            "right below",
            lambda window: max(240.0, window - _scene_height(window)),
            lambda c: draw_pixel_panel(c.session, c.facts, c.emit, c.items),
            shown=lambda session: "Pixel" in session.window.open_panels,
        ),
        Panel("Log", "bottom", lambda _: 130.0, lambda c: log.draw(c.session, c.items)),
        Panel(
            "Errors",
            "bottom",
            lambda _: 130.0,
            lambda c: draw_errors_panel(c.session, c.facts, c.emit, c.items),
            shown=lambda session: "Errors" in session.window.open_panels,
        ),
        Panel(
            "Histogram",
            "left below",
            lambda _: 300.0,
            lambda c: histogram.draw(c.facts, c.items),
            shown=lambda session: "Histogram" in session.window.open_panels,
        ),
    )
