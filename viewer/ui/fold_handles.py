"""What panels are folded with: a strip at the window's edge for the column, a button beside the tabs of each stack."""

from collections.abc import Sequence

from imgui_bundle import ImVec2, imgui

from viewer.ui.dock_layout import Stack
from viewer.ui.facts import UiFrame

STRIP = 14.0
"""Width in window units, at normal scale."""
COLUMN_LABEL = "fold panels"
"""Under which scripts click on the strip."""


def draw_column_handle(ui: UiFrame, folded: bool) -> None:
    """A strip along the left edge with an arrow: one click folds all panels into it, another one unfolds them."""
    style = imgui.get_style()
    width = STRIP * style.font_scale_main * style.font_scale_dpi
    flags = (
        imgui.WindowFlags_.no_decoration
        | imgui.WindowFlags_.no_saved_settings
        | imgui.WindowFlags_.no_nav
        | imgui.WindowFlags_.no_focus_on_appearing
    )
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(0.0, 0.0))
    imgui.push_style_var(imgui.StyleVar_.window_min_size, ImVec2(1.0, 1.0))
    imgui.push_style_var(imgui.StyleVar_.window_rounding, 0.0)
    imgui.push_style_color(imgui.Col_.window_bg, style.color_(imgui.Col_.menu_bar_bg))
    # Known to ImGui as a side bar: panels are docked in what it leaves.
    opened = imgui.internal.begin_viewport_side_bar("##fold", imgui.get_main_viewport(), imgui.Dir.left, width, flags)
    imgui.pop_style_color()
    imgui.pop_style_var(3)
    if opened:
        at, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
        if imgui.invisible_button(COLUMN_LABEL, ImVec2(max(room.x, 1.0), max(room.y, 1.0))):
            ui.emit("window.column")
        ui.rects.note(
            COLUMN_LABEL, "Show the panels again." if folded else "Fold the panels: more room for the picture."
        )
        size = imgui.get_font_size()
        _arrow(
            imgui.Dir.right if folded else imgui.Dir.left,
            ImVec2(at.x + (room.x - size) / 2.0, at.y + (room.y - size) / 2.0),
            imgui.is_item_hovered(),
        )
    imgui.end()


def _arrow(direction: imgui.Dir, at: ImVec2, bright: bool) -> None:
    color = imgui.get_color_u32(imgui.Col_.text if bright else imgui.Col_.text_disabled)
    imgui.internal.render_arrow(imgui.get_window_draw_list(), at, color, direction)


class StackHandles:
    """The buttons of the stacks; remembers which tab each of them was folded with."""

    def __init__(self) -> None:
        self._tabs: dict[int, int] = {}
        """Ids of the chosen tabs of folded stacks, by the ids of their nodes."""

    def draw(self, ui: UiFrame, stacks: Sequence[Stack], raised: str | None) -> None:
        """A button behind each stack's tabs; choosing another tab of a folded stack, or raising one of its panels, unfolds it."""
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
