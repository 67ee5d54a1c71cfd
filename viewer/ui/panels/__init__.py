"""List of the window's panels. A new panel is a file in this folder and an entry here."""

from collections.abc import Callable
from dataclasses import dataclass

from viewer.jobs.job import Background
from viewer.state.session import Session
from viewer.ui.dock_layout import Place
from viewer.ui.facts import UiFrame
from viewer.ui.panels.compare import ComparePanel
from viewer.ui.panels.divergence import draw_divergence_panel
from viewer.ui.panels.errors import draw_errors_panel
from viewer.ui.panels.groups import GroupsPanel
from viewer.ui.panels.histogram import HistogramPanel
from viewer.ui.panels.light import draw_light_panel
from viewer.ui.panels.log import LogPanel
from viewer.ui.panels.memory import MemoryPanel
from viewer.ui.panels.pixel import draw_pixel_panel
from viewer.ui.panels.scene import SceneLists, draw_scene_panel
from viewer.ui.panels.textures import TexturesPanel
from viewer.ui.panels.timings import TimingsPlot, draw_timings_panel
from viewer.ui.panels.training import TrainingPanel


@dataclass(frozen=True, eq=False)
class Panel:
    """Panel of the window: title, place and content."""

    title: str
    tip: str
    """Tooltip of its tab."""
    place: Place
    """Place in a new layout. Panels of one place are tabs, the first in front."""
    draw: Callable[[UiFrame], None]
    shown: Callable[[Session], bool] | None = None
    """Function that returns whether the panel is open; None for a panel that cannot be closed."""


def _on_request(title: str) -> Callable[[Session], bool]:
    return lambda session: title in session.window.open_panels


def make_panels(background: Background) -> tuple[Panel, ...]:
    """Make the panels of one window."""
    lists, plot, histogram = SceneLists(), TimingsPlot(), HistogramPanel()
    textures, groups, memory, log = TexturesPanel(), GroupsPanel(background), MemoryPanel(), LogPanel()
    training = TrainingPanel()
    return (
        Panel(
            "Compare",
            "What slots A and B show, how the picture compares them, and the figures of both.",
            "upper",
            ComparePanel().draw,
        ),
        Panel("Training", "Encode the scene, or continue training its pack while you look.", "upper", training.draw),
        Panel(
            "Scene",
            "The open file: cameras, nodes, materials, and what is missing or ignored.",
            "upper",
            lambda ui: draw_scene_panel(ui, lists),
        ),
        Panel("Textures", "All textures of the scene, with their figures in slot A's pack.", "upper", textures.draw),
        Panel("Groups", "Groups of slot A's pack: the textures that share one decoder.", "upper", groups.draw),
        Panel("Light", "View of the materials, and the light of the scene.", "lower", draw_light_panel),
        Panel("Memory", "Bytes of the original textures, and of what slots A and B show.", "lower", memory.draw),
        Panel(
            "Timings",
            "Time of each step of drawing in milliseconds, over the last 300 frames.",
            "lower",
            lambda ui: draw_timings_panel(ui, plot),
        ),
        Panel(
            "Divergence",
            "Number of different decoders in each block of pixels: the map, its colours and its figures.",
            "lower",
            draw_divergence_panel,
            lambda session: session.view.overlay.kind == "divergence",
        ),
        Panel(
            "Pixel",
            "Pixels around the mouse, enlarged, with their values in A and B.",
            "lower",
            draw_pixel_panel,
            _on_request("Pixel"),
        ),
        Panel(
            "Errors",
            "Textures or decoders by the difference between A and B, worst first.",
            "lower",
            draw_errors_panel,
            _on_request("Errors"),
        ),
        Panel(
            "Histogram",
            "Number of pixels by the difference between A and B.",
            "lower",
            histogram.draw,
            _on_request("Histogram"),
        ),
        Panel("Log", "All messages of this session with their times.", "lower", log.draw, _on_request("Log")),
    )
