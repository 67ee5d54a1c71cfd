"""All panels of the window. A new one is a file of its own and an entry here."""

from collections.abc import Callable
from dataclasses import dataclass

from viewer.jobs.background import Background
from viewer.state.session import Session
from viewer.ui.dock_layout import Place
from viewer.ui.facts import UiFrame
from viewer.ui.panels.compare import draw_compare_panel
from viewer.ui.panels.divergence import draw_divergence_panel
from viewer.ui.panels.errors import draw_errors_panel
from viewer.ui.panels.groups import GroupsPanel
from viewer.ui.panels.histogram import HistogramPanel
from viewer.ui.panels.light import draw_light_panel
from viewer.ui.panels.log import LogPanel
from viewer.ui.panels.memory import MemoryPanel
from viewer.ui.panels.pixel import draw_pixel_panel
from viewer.ui.panels.scene import OpenField, SceneLists, draw_scene_panel
from viewer.ui.panels.textures import TexturesPanel
from viewer.ui.panels.timings import TimingsPlot, draw_timings_panel
from viewer.ui.panels.training import TrainingPanel


@dataclass(frozen=True, eq=False)
class Panel:
    """A window within the window."""

    title: str
    side: Place
    """Where it is docked at first; panels of one place are tabs, the first in front."""
    height: Callable[[float], float]
    """At first, from the height of the window; of a place that shares its column, the first panel's counts."""
    draw: Callable[[UiFrame], None]
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
        Panel("Compare", "left", lambda _: 440.0, draw_compare_panel),
        Panel("Timings", "left below", lambda _: 300.0, lambda ui: draw_timings_panel(ui, plot)),
        Panel("Light", "left below", lambda _: 300.0, draw_light_panel),
        Panel("Memory", "left below", lambda _: 300.0, memory.draw),
        Panel("Scene", "right", _scene_height, lambda ui: draw_scene_panel(ui, open_field, lists)),
        Panel("Textures", "right", _scene_height, textures.draw),
        Panel("Groups", "right", _scene_height, groups.draw),
        Panel("Training", "right", _scene_height, training.draw),
        Panel(
            "Divergence",
            "right below",
            lambda window: max(240.0, window - _scene_height(window)),
            draw_divergence_panel,
            shown=lambda session: session.view.overlay.kind == "divergence",
        ),
        Panel(
            "Pixel",
            "right below",
            lambda window: max(240.0, window - _scene_height(window)),
            draw_pixel_panel,
            shown=lambda session: "Pixel" in session.window.open_panels,
        ),
        Panel("Log", "bottom", lambda _: 130.0, log.draw),
        Panel(
            "Errors",
            "bottom",
            lambda _: 130.0,
            draw_errors_panel,
            shown=lambda session: "Errors" in session.window.open_panels,
        ),
        Panel(
            "Histogram",
            "left below",
            lambda _: 300.0,
            histogram.draw,
            shown=lambda session: "Histogram" in session.window.open_panels,
        ),
    )
