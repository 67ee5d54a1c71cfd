"""Docked layout of the panels: a column of two stacks of tabs beside the picture, which folds and can be reset.

ImGui manages the dock nodes, saves them in its settings and lets the user drag them. This module adds, frame by frame:

- Without a saved layout, or after a reset, `_build` splits the dock space into the picture and the column, and docks each panel by
  its place. In a low window the column is a single stack.
- The width of the column follows the scale of the interface (`_follow_scale`); a width that the user dragged is remembered in units
  of normal scale.
- A folded stack gets the height of its tab bar, and the other stack of the column the rest (`_fold`).
- New layouts need focus to choose the front tabs. ImGui takes one focus a frame, so `bring_to_front` gives it to one waiting panel
  at a time; until then the layout `is_settling`.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from imgui_bundle import ImVec2, imgui

from viewer.ui.facts import UiFrame
from viewer.ui.widgets import Area, grid, side_bar

Place = Literal["upper", "lower"]
DOCK_SPACE = "column"
COLUMN_WIDTH = 350.0
"""Width of the column of panels, in window units at normal scale: in a window of 1280x720 the picture gets two thirds."""
WIDEST_COLUMN = 440.0
COLUMN_SHARE = 0.22
"""Width of the column in a large window, as a share of the window."""
LARGEST_SAVED = 0.4
"""Largest width of a saved column, as a share of the window; a wider one gets the default width."""
PICTURE_WIDTH = 300.0
"""Least width of the picture, in window units at normal scale; in a narrow window it is half of the window."""
NARROWEST_OPEN = 800.0
"""Width of the window in units of normal scale, below which the column is folded at first."""
LOWEST_FOR_STACKS = 560.0
"""Height of the window in units of normal scale, below which the column is one stack of tabs."""
LOWER_SHARE = 0.36
"""Height of the lower stack at first, as a share of the column."""


@dataclass(frozen=True)
class Stack:
    """Panels that are tabs of one dock node, above or below another stack."""

    titles: tuple[str, ...]
    node: imgui.internal.DockNode
    area: Area


def titles_by_place(places: Mapping[str, Place], height: float) -> dict[Place, list[str]]:
    """Return the panels of each place in a window of this height in units of normal scale. `places`: place by title."""
    titles: dict[Place, list[str]] = {}
    for title, place in places.items():
        titles.setdefault("upper" if height < LOWEST_FOR_STACKS else place, []).append(title)
    return titles


def column_width(width: float) -> float:
    """Return the width of the column in a window of this width, in units of normal scale."""
    wanted = min(max(COLUMN_WIDTH, COLUMN_SHARE * width), WIDEST_COLUMN)
    return min(wanted, max(width - PICTURE_WIDTH, 0.5 * width))


def folds_at_first(width: float) -> bool:
    """Return True where a window of this width, in units of normal scale, opens with its column folded."""
    return width < NARROWEST_OPEN


class DockLayout:
    """Dock space of a window."""

    def __init__(self) -> None:
        self._front: list[str] = []
        """Panels that wait to come to the front; the last one is next."""
        self._saw_menu_bar = False
        """True after the first frame, when the viewport knows the height of the menu bar."""
        self._placed = False
        self._saw_tabs = False
        """True after the first frame with panels, in which the chosen tabs of a saved layout are read."""
        self._pause = 0
        """Number of frames until the next panel may be focused, or the last one is visible."""
        self._folded: frozenset[str] = frozenset()
        self._scale: float | None = None
        """Scale that the widths of the columns are made for."""
        self._heights: dict[int, float] = {}
        """Heights of folded stacks before folding, as shares of their column, by the ids of their nodes."""
        self._widths: dict[int, tuple[float, float]] = {}
        """Widths of columns by the ids of their nodes: (requested, in units of normal scale; given, in window units)."""

    @property
    def folded(self) -> frozenset[str]:
        """Titles of the panels in stacks that are folded to their tabs."""
        return self._folded

    @property
    def is_placed(self) -> bool:
        """True once panels are docked and the area of the picture is known."""
        return self._placed

    @property
    def is_settling(self) -> bool:
        """True while panels wait to come to the front after a new layout."""
        return not self._saw_menu_bar or bool(self._front) or self._pause > 0

    def draw(self, places: Mapping[str, Place], scale: float, reset: bool, folded: Collection[str]) -> Area:
        """Submit the dock space and return the area of the picture. With `reset`, or without a layout, all panels are docked again.

        Stacks with a panel in `folded` are as high as their tabs.
        """
        viewport = imgui.get_main_viewport()
        dock_space = imgui.get_id(DOCK_SPACE)
        known = imgui.internal.dock_builder_get_node(dock_space)
        if self._saw_menu_bar and (reset or known is None or not (known.is_split_node() or known.windows)):
            self._build(dock_space, places, viewport, scale)
            self._scale = scale
        elif self._saw_menu_bar:
            self._follow_scale(places, scale, viewport)
        self._fold(places, folded)
        self._placed, self._saw_menu_bar = self._saw_menu_bar, True
        imgui.dock_space_over_viewport(dock_space, viewport, imgui.DockNodeFlags_.passthru_central_node)
        central = imgui.internal.dock_builder_get_central_node(dock_space)
        low, size = (viewport.work_pos, viewport.work_size) if central is None else (central.pos, central.size)
        return Area(low.x, low.y, low.x + size.x, low.y + size.y)

    def bring_to_front(self, titles: Iterable[str]) -> None:
        """Bring the next waiting panel to the front; call it after drawing the panels."""
        if not self._saw_tabs:
            # ImGui selects the window that is drawn last, not the saved tab. The saved tab may belong to a closed panel.
            self._saw_tabs, front = True, dict[int, str]()
            for title in titles:
                if (node := _node(title)) is not None and (_is_chosen(title) or node.id_ not in front):
                    front[node.id_] = title
            self.bring_all(list(front.values()))
        self._pause = max(0, self._pause - 1)
        if self._front and self._pause == 0:
            # One panel per frame: a tab bar selects the tab of the focused window.
            imgui.set_window_focus(self._front.pop())
            self._pause = 2

    def bring(self, title: str) -> None:
        """Bring a panel to the front."""
        self._front = [title, *self._front]
        # The window of a panel that was closed is made in this frame, and can be focused from the next one on.
        self._pause = max(self._pause, 2)

    def bring_all(self, titles: Sequence[str]) -> None:
        """Bring panels to the front, one for each stack of tabs."""
        self._front = list(titles)
        self._pause = 3

    def stacks(self, titles: Iterable[str]) -> list[Stack]:
        """Return the stacks of shown panels that share a column with another stack, from top to bottom."""
        members_of_node: dict[int, tuple[imgui.internal.DockNode, list[str]]] = {}
        for title in titles:
            node = _node(title)
            if (
                node is not None
                and node.parent_node is not None
                and node.parent_node.split_axis == imgui.internal.Axis.y
            ):
                members_of_node.setdefault(node.id_, (node, []))[1].append(title)
        stacks = [
            Stack(
                tuple(members), node, Area(node.pos.x, node.pos.y, node.pos.x + node.size.x, node.pos.y + node.size.y)
            )
            for node, members in members_of_node.values()
        ]
        return sorted(stacks, key=lambda stack: stack.area.top)

    def _fold(self, titles: Iterable[str], folded: Collection[str]) -> None:
        """Give folded stacks the height of their tabs and unfolded ones their former height. The other stack takes the rest."""
        stacks = self.stacks(titles)
        tabs, small = imgui.get_frame_height(), set[str]()
        for stack in stacks:
            node, parent = stack.node, stack.node.parent_node
            others = [other for other in stacks if other.node.parent_node.id_ == parent.id_ and other is not stack]
            is_folded, was_folded = _is_folded(stack, folded), node.id_ in self._heights
            # A column has at least one open stack.
            if not others or _is_folded(others[0], folded) or not (is_folded or was_folded):
                continue
            if is_folded:
                small.update(stack.titles)
            if is_folded and was_folded and node.size_ref.y == tabs:
                continue
            room = parent.size.y - imgui.get_style().docking_separator_size
            if is_folded:
                if node.size_ref.y > 2.0 * tabs:
                    self._heights[node.id_] = node.size_ref.y / (node.size_ref.y + others[0].node.size_ref.y)
                else:
                    self._heights.setdefault(node.id_, LOWER_SHARE)
                height = tabs
            else:
                height = self._heights.pop(node.id_) * room
            node.size_ref = ImVec2(node.size_ref.x, height)
            others[0].node.size_ref = ImVec2(others[0].node.size_ref.x, max(room - height, tabs))
        self._folded = frozenset(small)

    def _follow_scale(self, titles: Iterable[str], scale: float, viewport: imgui.Viewport) -> None:
        """Scale the width of the column with its content, and widen a saved column that is too narrow."""
        if scale == self._scale:
            return
        widest = scale * column_width(max(viewport.work_size.x, 1.0) / scale)
        columns: dict[int, imgui.internal.DockNode] = {}
        for title in titles:
            node = _node(title)
            while node is not None and node.parent_node is not None:
                if node.parent_node.split_axis == imgui.internal.Axis.x:
                    columns[node.id_] = node
                node = node.parent_node
        if not columns:
            # Hidden panels have no column. Its width is set when they are shown again.
            return
        for number, node in columns.items():
            units, given = self._widths.get(number, (0.0, 0.0))
            if self._scale is None:
                units = max(node.size_ref.x, 0.8 * widest) / scale
            elif node.size_ref.x != given:
                # The width differs from the given one, so the user has dragged it.
                units = node.size_ref.x / self._scale
            given = units * scale
            if self._scale is not None or given > LARGEST_SAVED * viewport.work_size.x:
                # A width saved at another scale may take half of the window.
                given = min(given, widest)
            self._widths[number] = (units, given)
            node.size_ref = ImVec2(given, node.size_ref.y)
        self._scale = scale

    def _build(self, root: int, places: Mapping[str, Place], viewport: imgui.Viewport, scale: float) -> None:
        builder = imgui.internal
        size = ImVec2(max(viewport.work_size.x, 1.0), max(viewport.work_size.y, 1.0))
        titles = titles_by_place(places, size.y / scale)
        builder.dock_builder_remove_node(root)
        builder.dock_builder_add_node(root, builder.DockNodeFlagsPrivate_.dock_space)
        builder.dock_builder_set_node_pos(root, viewport.work_pos)
        builder.dock_builder_set_node_size(root, size)
        self._heights.clear()
        column, _ = _split(root, imgui.Dir.left, scale * column_width(size.x / scale) / size.x)
        nodes: dict[Place, int] = {"upper": column}
        if "lower" in titles:
            nodes["lower"], nodes["upper"] = _split(column, imgui.Dir.down, LOWER_SHARE)
        for place, members in titles.items():
            for title in members:
                builder.dock_builder_dock_window(title, nodes[place])
        builder.dock_builder_finish(root)
        self._front, self._saw_tabs = [members[0] for members in titles.values()], True
        # ImGui makes a node's tab bar in the frame after its windows are docked.
        self._pause = 3


def _is_folded(stack: Stack, folded: Collection[str]) -> bool:
    return any(title in folded for title in stack.titles)


def _node(title: str) -> imgui.internal.DockNode | None:
    """Return the dock node of a panel; None for a hidden or floating panel."""
    window = imgui.internal.find_window_by_name(title)
    return window.dock_node if window is not None else None


def _is_chosen(title: str) -> bool:
    """Return whether a panel is the selected tab of its stack."""
    node, window = _node(title), imgui.internal.find_window_by_name(title)
    return node is not None and window is not None and node.selected_tab_id == window.tab_id


def _split(node: int, direction: imgui.Dir, share: float) -> tuple[int, int]:
    """Split a node and return (new node on that side, rest)."""
    _, there, rest = imgui.internal.dock_builder_split_node_py(node, direction, min(max(share, 0.05), 0.9))
    return there, rest


STRIP = 3.0
"""Width of the strip in units of the grid."""
COLUMN_LABEL = "fold panels"
"""Label under which scripts click on the strip."""


def draw_column_handle(ui: UiFrame, folded: bool) -> None:
    """Draw a strip with an arrow along the left edge. A click on it folds or unfolds all panels."""
    with side_bar("##fold", imgui.Dir.left, grid(STRIP), ImVec2(0.0, 0.0)) as opened:
        if not opened:
            return
        at, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
        if imgui.invisible_button(COLUMN_LABEL, ImVec2(max(room.x, 1.0), max(room.y, 1.0))):
            ui.emit("window.column")
        ui.rects.note(COLUMN_LABEL, "Show the panels." if folded else "Fold the panels to make room for the picture.")
        size = imgui.get_font_size()
        _arrow(
            imgui.Dir.right if folded else imgui.Dir.left,
            ImVec2(at.x + (room.x - size) / 2.0, at.y + (room.y - size) / 2.0),
            imgui.is_item_hovered(),
        )


def _arrow(direction: imgui.Dir, at: ImVec2, bright: bool) -> None:
    color = imgui.get_color_u32(imgui.Col_.text if bright else imgui.Col_.text_disabled)
    imgui.internal.render_arrow(imgui.get_window_draw_list(), at, color, direction)


class StackHandles:
    """Buttons that fold the stacks."""

    def __init__(self) -> None:
        self._tabs: dict[int, int] = {}
        """Chosen tabs of folded stacks, by the ids of their nodes."""

    def draw(self, ui: UiFrame, stacks: Sequence[Stack], raised: str | None) -> None:
        """Draw a button behind each stack's tabs. A folded stack unfolds when another of its tabs is chosen or a panel is raised."""
        for number, stack in enumerate(stacks):
            folded = [title for title in stack.titles if title in ui.session.settings.folded_panels]
            if not folded:
                self._tabs.pop(stack.node.id_, None)
            elif stack.node.tab_bar is not None:
                chosen = stack.node.tab_bar.selected_tab_id
                if raised in stack.titles or self._tabs.setdefault(stack.node.id_, chosen) != chosen:
                    self._unfold(folded, ui)
                    continue
            if imgui.internal.dock_node_begin_amend_tab_bar(stack.node):
                self._button(f"fold {'upper' if number == 0 else 'lower'} panels", stack, folded, ui)
                imgui.internal.dock_node_end_amend_tab_bar()

    def _button(self, label: str, stack: Stack, folded: list[str], ui: UiFrame) -> None:
        flags = imgui.TabItemFlags_.trailing | imgui.TabItemFlags_.no_tooltip
        clicked = imgui.tab_item_button(f"  ##{label}", flags)
        ui.rects.note(label, "Unfold these panels." if folded else "Fold these panels to their tabs.")
        low, high, size = imgui.get_item_rect_min(), imgui.get_item_rect_max(), imgui.get_font_size()
        middle = ImVec2((low.x + high.x - size) / 2.0, (low.y + high.y - size) / 2.0)
        _arrow(imgui.Dir.right if folded else imgui.Dir.down, middle, imgui.is_item_hovered())
        if clicked and folded:
            self._unfold(folded, ui)
        elif clicked:
            ui.emit("window.stack", stack.titles[0], False)

    @staticmethod
    def _unfold(titles: Sequence[str], ui: UiFrame) -> None:
        for title in titles:
            ui.emit("window.stack", title, True)
