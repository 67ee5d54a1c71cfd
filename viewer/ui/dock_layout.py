"""The docked layout of panels around the picture: fits the window's size, and can be reset."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from imgui_bundle import ImVec2, imgui

from viewer.ui.widgets import Area

Place = Literal["left", "left below", "right", "right below", "bottom"]
MERGED: dict[Place, Place] = {"left below": "left", "right below": "right", "bottom": "left"}
"""Where a place's panels become tabs when the window is too low for it."""
DOCK_SPACE = "panels"
NARROWEST_FOR_TWO = 660.0
"""Window units, at normal scale: in a narrower window all panels are tabs of one column."""
LOWEST_FOR_STACKS = 560.0
"""Window units, at normal scale: in a lower window each column is one stack of tabs."""
BOTTOM_HEIGHT = 130.0


@dataclass(frozen=True)
class Docked:
    """A panel's place in the layout that a window opens with."""

    title: str
    place: Place
    height: float
    """Of its place, where that shares a column; the first panel's counts."""


def places_for(panels: Sequence[Docked], width: float, height: float) -> dict[Place, list[Docked]]:
    """Panels by place, for a window of this size in units of normal scale."""
    places: dict[Place, list[Docked]] = {}
    for panel in panels:
        place = panel.place
        if height < LOWEST_FOR_STACKS:
            place = MERGED.get(place, place)
        if width < NARROWEST_FOR_TWO:
            place = "left"
        places.setdefault(place, []).append(panel)
    return places


def column_width(share: float, width: float, low: float, high: float) -> float:
    """Of a column, in units of normal scale; a narrow window keeps half for the picture."""
    return min(max(share * width, low), high, 0.5 * width)


class DockLayout:
    """The dock space of one window."""

    def __init__(self) -> None:
        self._front: list[str] = []
        """Panels that are to come to the front, the last one first."""
        self._saw_menu_bar = False
        """Whether a frame has passed: only then the viewport knows what a menu bar leaves of it."""
        self._placed = False
        self._pause = 0
        """Frames until the next panel may be focused, or until the last one is visible."""

    @property
    def is_placed(self) -> bool:
        """Whether panels have their places, so that the area of the picture is known; some may still come to the front."""
        return self._placed

    @property
    def is_settling(self) -> bool:
        """Whether panels are still to come to the front after a new layout."""
        return not self._saw_menu_bar or bool(self._front) or self._pause > 0

    def draw(self, panels: Sequence[Docked], scale: float, reset: bool) -> Area:
        """Submit the dock space, docking all panels anew with `reset` or where there is no layout; what it leaves to the picture."""
        viewport = imgui.get_main_viewport()
        dock_space = imgui.get_id(DOCK_SPACE)
        known = imgui.internal.dock_builder_get_node(dock_space)
        if self._saw_menu_bar and (reset or known is None or not (known.is_split_node() or known.windows)):
            self._build(dock_space, panels, viewport, scale)
        self._placed, self._saw_menu_bar = self._saw_menu_bar, True
        imgui.dock_space_over_viewport(dock_space, viewport, imgui.DockNodeFlags_.passthru_central_node)
        central = imgui.internal.dock_builder_get_central_node(dock_space)
        low, size = (viewport.work_pos, viewport.work_size) if central is None else (central.pos, central.size)
        return Area(low.x, low.y, low.x + size.x, low.y + size.y)

    def bring_to_front(self) -> None:
        """Let the next panel that is waiting for it come to the front; to be called when the panels have been drawn."""
        self._pause = max(0, self._pause - 1)
        if self._front and self._pause == 0:
            # One after the other: a tab bar takes the choice from the window that has the focus.
            imgui.set_window_focus(self._front.pop())
            self._pause = 2

    def bring(self, title: str) -> None:
        """Bring a panel to the front."""
        self._front = [title, *self._front]
        # One that was closed is a window again in this frame only.
        self._pause = max(self._pause, 2)

    def bring_all(self, titles: Sequence[str]) -> None:
        """Bring these panels to the front, one for each stack of tabs."""
        self._front = list(titles)
        self._pause = 3

    def _build(self, root: int, panels: Sequence[Docked], viewport: imgui.Viewport, scale: float) -> None:
        builder = imgui.internal
        size = ImVec2(max(viewport.work_size.x, 1.0), max(viewport.work_size.y, 1.0))
        places = places_for(panels, size.x / scale, size.y / scale)
        builder.dock_builder_remove_node(root)
        builder.dock_builder_add_node(root, builder.DockNodeFlagsPrivate_.dock_space)
        builder.dock_builder_set_node_pos(root, viewport.work_pos)
        builder.dock_builder_set_node_size(root, size)
        nodes: dict[Place, int] = {}
        rest, left_width = root, size.x
        if "left" in places:
            width = scale * column_width(0.27, size.x / scale, 300.0, 380.0)
            nodes["left"], rest = _split(rest, imgui.Dir.left, width / left_width)
            left_width -= width
        if "right" in places:
            width = scale * column_width(0.27, size.x / scale, 240.0, 420.0)
            nodes["right"], rest = _split(rest, imgui.Dir.right, width / left_width)
        if "bottom" in places:
            nodes["bottom"], rest = _split(rest, imgui.Dir.down, scale * BOTTOM_HEIGHT / size.y)
        for place, below in (("left", "left below"), ("right", "right below")):
            if below in places and place in nodes:
                share = min(max(scale * places[place][0].height / size.y, 0.2), 0.8)
                nodes[below], nodes[place] = _split(nodes[place], imgui.Dir.down, 1.0 - share)
        for place, members in places.items():
            for panel in members:
                builder.dock_builder_dock_window(panel.title, nodes[place])
        builder.dock_builder_finish(root)
        self._front = [members[0].title for members in places.values()]
        # ImGui gives a tab bar to a node in the frame after its windows have come.
        self._pause = 3


def _split(node: int, direction: imgui.Dir, share: float) -> tuple[int, int]:
    """(the new node on that side, what is left)."""
    _, there, rest = imgui.internal.dock_builder_split_node_py(node, direction, min(max(share, 0.05), 0.9))
    return there, rest
