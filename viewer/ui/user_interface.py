"""User interface of the window, drawn in each frame. It reads the session, runs commands, and makes no OpenGL call."""

from collections.abc import Sequence

from imgui_bundle import ImVec2, imgui

from viewer.jobs.job import Background
from viewer.state.session import Session
from viewer.ui.annotations import (
    PictureWarnings,
    draw_block,
    draw_hints,
    draw_labels,
    draw_map_legend,
    draw_pixel,
    draw_toasts,
    draw_way_back,
)
from viewer.ui.dock_layout import DockLayout, StackHandles, draw_column_handle, folds_at_first
from viewer.ui.facts import FIRST_PICTURE, Emit, UiFrame
from viewer.ui.file_dialog import FileDialog
from viewer.ui.first_run_card import FirstRunCard
from viewer.ui.flat_window import FlatWindow
from viewer.ui.help.sheets import make_sheets
from viewer.ui.menu_bar import draw_menu_bar
from viewer.ui.palette import Palette
from viewer.ui.panels import make_panels
from viewer.ui.panels.training import EncodeOffer
from viewer.ui.picture_input import PictureInput
from viewer.ui.status_bar import draw_status_bar
from viewer.ui.widgets import Area, WidgetRects, ui_scale

SETTLING_FRAMES = 3
"""Number of frames that ImGui's layout needs after an event."""


class UserInterface:
    """Panels, annotations and input over the picture."""

    def __init__(self) -> None:
        self.rects = WidgetRects()
        self.background = Background()
        """Background jobs of the panels."""
        self._input = PictureInput(self.background)
        self._all_panels = make_panels(self.background)
        self._layout = DockLayout()
        self._flat = FlatWindow(self.background)
        self._palette = Palette()
        self._sheets = make_sheets()
        self._warnings = PictureWarnings()
        self._offer = EncodeOffer()
        self._first_run_card = FirstRunCard()
        self._file_dialog = FileDialog()
        self._in_front: list[str] = []
        """Panels that were visible in the last frame with panels. They come to the front when panels are shown again."""
        self._were_shown = True
        self._handles = StackHandles()
        self._area = Area(0.0, 0.0, 1.0, 1.0)
        """Area of the picture beside panels in the last frame."""
        self._picture_area: Area | None = None
        self._raised: str | None = None
        """Title of the panel that the next frame brings to the front."""
        self._resets_layout = False
        """True if the next frame docks all panels again."""

    @property
    def picture_area(self) -> Area | None:
        """Area of the picture in the last frame; None before it is known."""
        return self._picture_area

    @property
    def panel_titles(self) -> tuple[str, ...]:
        """Titles of all panels, shown or not."""
        return tuple(panel.title for panel in self._all_panels)

    @property
    def panels_in_front(self) -> tuple[str, ...]:
        """Titles of the panels that were visible in the last frame with panels."""
        return tuple(self._in_front)

    def shows(self, panel: str) -> bool:
        """Return whether the last frame drew the content of this panel."""
        return self._were_shown and panel in self._in_front and panel not in self._layout.folded

    def bring_to_front(self, panels: Sequence[str]) -> None:
        """Bring panels to the front that were there in an earlier user interface, whose ImGui context was lost."""
        if panels:
            self._in_front, self._were_shown = list(panels), False

    def raise_panel(self, title: str) -> None:
        """Bring a panel to the front in the next frame that shows panels."""
        self._raised = title

    def reset_layout(self) -> None:
        """Dock all panels again in the next frame that shows panels."""
        self._resets_layout = True

    def is_settling(self, session: Session) -> bool:
        """Return whether the next frame changes the interface without input."""
        asked = self._resets_layout or self._raised is not None
        waits = self._file_dialog.system.has_answer or self._input.flight.is_ending
        moves = not self._layout.is_placed if session.window.column_folded else self._layout.is_settling
        return waits or (session.window.show_panels and (asked or moves))

    def handle_input(self, session: Session, emit: Emit) -> None:
        """Run the commands of keys and of the mouse over the picture. Call it between ImGui's new_frame and `draw`."""
        window, has_popup = session.window, imgui.is_popup_open("", imgui.PopupFlags_.any_popup)
        list_is_open = has_popup or window.palette is not None or window.file_dialog
        self._input.handle(session, self._area, emit, keys=not list_is_open)

    def draw(self, ui: UiFrame, picture: imgui.ImTextureRef | None) -> None:
        """Draw the user interface, between `handle_input` and ImGui's render. `picture` is a texture with row 0 at the bottom."""
        session = ui.session
        ui.rects.begin()
        # Asked before panels are drawn: a list that closes on this frame's Escape is still open now.
        popup_is_open = imgui.is_popup_open("", imgui.PopupFlags_.any_popup)
        display = imgui.get_io().display_size
        size = (max(display.x, 1.0), max(display.y, 1.0))
        bar = draw_menu_bar(ui) if session.window.show_panels else 0.0
        if session.window.show_panels:
            draw_status_bar(ui)
            draw_column_handle(ui, session.window.column_folded)
        area = self._layout_panels(ui) if session.window.show_panels else Area(0.0, 0.0, *size)
        self._area = area
        self._picture_area = area if not session.window.show_panels or self._layout.is_placed else None
        _draw_picture(picture, ui, area)
        if session.window.show_panels:
            self._warnings.draw(ui, area)
        draw_block(ui, area)
        draw_pixel(ui, area)
        shown = session.window.show_panels and not session.window.column_folded
        if shown and not self._were_shown and self._in_front:
            self._layout.bring_all(self._in_front)
        self._were_shown = shown
        if shown:
            self._panels(ui)
        if session.window.show_panels:
            self._raise_panel(shown)
        beside_card = self._first_run_card.draw(ui, area)
        if session.window.show_panels:
            if not session.window.show_help:
                draw_hints(ui, area)
            above_offer = self._offer.draw(ui, area, beside_card)
            self._flat.draw(ui)
        else:
            above_offer = area
            draw_way_back(ui, area)
        draw_map_legend(ui, beside_card)
        for sheet in self._sheets:
            sheet.draw(ui, size, bar)
        self._file_dialog.draw(ui, size)
        self._palette.draw(ui, size)
        escape = popup_is_open and imgui.is_key_pressed(imgui.Key.escape, repeat=False)
        # A list may have closed itself on this key.
        if escape and imgui.is_popup_open("", imgui.PopupFlags_.any_popup):
            imgui.internal.close_popup_to_level(0, True)
        low = min(beside_card.bottom, above_offer.bottom)
        draw_toasts(session.window.toasts, Area(beside_card.left, beside_card.top, beside_card.right, low))
        self._input.flight.draw(area, ui.rects)
        ui.rects.tooltips.end()

    def _layout_panels(self, ui: UiFrame) -> Area:
        """Dock the panels, and return the area of the picture."""
        settings, scale = ui.session.settings, ui_scale()
        places = {panel.title: panel.place for panel in self._all_panels}
        if settings.column_folded is None:
            narrow = folds_at_first(imgui.get_main_viewport().size.x / scale)
            if narrow != ui.session.window.column_folded:
                ui.emit("window.fit-column", narrow)
        reset, self._resets_layout = self._resets_layout, False
        area = self._layout.draw(places, scale, reset, settings.folded_panels)
        # The picture needs at least one pixel.
        return Area(area.left, area.top, max(area.right, area.left + 1.0), max(area.bottom, area.top + 1.0))

    def _panels(self, ui: UiFrame) -> None:
        session = ui.session
        hidden = session.settings.hidden_panels
        in_front: list[str] = []
        shown: list[str] = []
        for panel in self._all_panels:
            if panel.title in hidden or not (panel.shown is None or panel.shown(session)):
                continue
            opened, stays = imgui.begin(
                panel.title, None if panel.shown is None else True, imgui.WindowFlags_.no_collapse
            )
            ui.rects.note(panel.title, panel.tip)
            shown.append(panel.title)
            if opened:
                in_front.append(panel.title)
                if panel.title not in self._layout.folded:
                    panel.draw(ui)
            imgui.end()
            if stays is False:
                ui.emit("window.panel", panel.title, False)
        if not self._layout.is_settling:
            self._in_front = in_front
        self._handles.draw(ui, self._layout.stacks(shown), self._raised)

    def _raise_panel(self, shown: bool) -> None:
        """Bring the requested panel to the front, unless the column is folded."""
        raised, self._raised = self._raised, None
        if raised is not None and shown:
            self._layout.bring(raised)
        if shown:
            self._layout.bring_to_front(self.panel_titles)


def _draw_picture(picture: imgui.ImTextureRef | None, ui: UiFrame, area: Area) -> None:
    """Draw the picture with its labels; before the first picture, a text about the work."""
    draw_list = imgui.get_background_draw_list()
    if picture is not None:
        corners = (ImVec2(area.left, area.top), ImVec2(area.right, area.bottom), ImVec2(0, 1), ImVec2(1, 0))
        draw_list.add_image(picture, *corners)
        draw_labels(ui, area)
        return
    size = imgui.calc_text_size(FIRST_PICTURE)
    middle = ImVec2((area.left + area.right - size.x) / 2.0, (area.top + area.bottom - size.y) / 2.0)
    draw_list.add_text(middle, imgui.get_color_u32(imgui.Col_.text), FIRST_PICTURE)
