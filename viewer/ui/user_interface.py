"""The whole user interface of one frame. Reads the session, runs commands; makes no OpenGL call."""

from imgui_bundle import ImVec2, imgui

from viewer.jobs.background import Background
from viewer.state.session import Session
from viewer.training.live_training import LiveTraining
from viewer.ui.annotations import draw_block, draw_hints, draw_labels, draw_pixel, draw_toasts
from viewer.ui.dock_layout import Docked, DockLayout
from viewer.ui.facts import Emit, FrameFacts
from viewer.ui.flat_window import FlatWindow
from viewer.ui.key_sheet import KeySheet
from viewer.ui.menu_bar import draw_menu_bar
from viewer.ui.palette import Palette
from viewer.ui.panels import PanelContext, make_panels
from viewer.ui.picture_input import PictureInput
from viewer.ui.training_panel import EncodeOffer
from viewer.ui.widgets import Area, WidgetRects

SETTLING_FRAMES = 3
"""Frames that ImGui needs after an event until its layout rests."""


class UserInterface:
    """Panels, annotations and input over the picture."""

    def __init__(self) -> None:
        self.items = WidgetRects()
        self.background = Background()
        """What panels have computed beside the frames."""
        self._input = PictureInput()
        self._all_panels = make_panels(self.background)
        self._layout = DockLayout()
        self._flat = FlatWindow(self.background)
        self._palette = Palette()
        self._key_sheet = KeySheet()
        self._offer = EncodeOffer()
        self._in_front: list[str] = []
        """Panels that were seen when panels were drawn last: they come to the front when all come back."""
        self._were_shown = True
        self._picture_area: Area | None = None

    @property
    def picture_area(self) -> Area | None:
        """What panels leave to the picture, as of the last frame; None before that is known."""
        return self._picture_area

    @property
    def panel_titles(self) -> tuple[str, ...]:
        """Of all panels, shown or not."""
        return tuple(panel.title for panel in self._all_panels)

    def take_over(self, earlier: "UserInterface") -> None:
        """Show the panels in front that were so in `earlier`, whose ImGui is gone."""
        if earlier._in_front:
            self._in_front, self._were_shown = earlier._in_front, False

    def is_settling(self, session: Session) -> bool:
        """Whether the next frame puts panels elsewhere although nothing happens."""
        asked = session.requests.reset_layout or session.requests.raised_panel is not None
        return session.window.show_panels and (asked or self._layout.is_settling)

    def draw(
        self,
        session: Session,
        training: LiveTraining,
        facts: FrameFacts,
        picture: imgui.ImTextureRef | None,
        emit: Emit,
    ) -> None:
        """Everything between ImGui's new_frame and render. `picture` is an OpenGL texture with row 0 at the bottom."""
        self.items.clear()
        # Asked before the panels: a list that this frame's Escape closes still owns the key.
        list_is_open = imgui.is_popup_open("", imgui.PopupFlags_.any_popup) or session.window.palette is not None
        display = imgui.get_io().display_size
        size = (max(display.x, 1.0), max(display.y, 1.0))
        bar = draw_menu_bar(session, emit, self.items) if session.window.show_panels else 0.0
        area = self._layout_panels(session, emit) if session.window.show_panels else Area(0.0, 0.0, *size)
        self._picture_area = area if not session.window.show_panels or self._layout.is_placed else None
        if picture is not None:
            corners = (ImVec2(area.left, area.top), ImVec2(area.right, area.bottom), ImVec2(0, 1), ImVec2(1, 0))
            imgui.get_background_draw_list().add_image(picture, *corners)
        draw_labels(session, area, self.items)
        draw_block(session, facts, area)
        draw_pixel(session, facts, area)
        if session.window.show_panels:
            if not self._were_shown:
                self._layout.bring_all(self._in_front)
            self._panels(session, training, facts, emit)
            if not session.window.show_help:
                draw_hints(session, area)
            self._offer.draw(session, training, area, emit, self.items)
            self._flat.draw(session, facts, emit, self.items)
        self._were_shown = session.window.show_panels
        self._key_sheet.draw(session, size, bar, emit, self.items)
        self._palette.draw(session, size, emit, self.items)
        draw_toasts(session.window.toasts, area)
        self._input.handle(session, area, emit, keys=not list_is_open)

    def _layout_panels(self, session: Session, emit: Emit) -> Area:
        """Say where panels stand; the rectangle that they leave to the picture."""
        style, height = imgui.get_style(), imgui.get_main_viewport().work_size.y
        places = [Docked(panel.title, panel.side, panel.height(height)) for panel in self._all_panels]
        area = self._layout.draw(places, style.font_scale_main * style.font_scale_dpi, session.requests.reset_layout)
        if session.requests.reset_layout:
            emit("window.layout-done")
        # A picture has at least a pixel.
        return Area(area.left, area.top, max(area.right, area.left + 1.0), max(area.bottom, area.top + 1.0))

    def _panels(self, session: Session, training: LiveTraining, facts: FrameFacts, emit: Emit) -> None:
        context = PanelContext(session, training, facts, emit, self.items)
        hidden = session.settings.hidden_panels
        in_front: list[str] = []
        for panel in self._all_panels:
            if panel.title in hidden or not panel.shown(session):
                continue
            opened, stays = imgui.begin(panel.title, True, imgui.WindowFlags_.no_collapse)
            self.items.note(panel.title)
            if opened:
                in_front.append(panel.title)
                panel.draw(context)
            imgui.end()
            if not stays:
                emit("window.panel", panel.title, False)
        if not self._layout.is_settling:
            self._in_front = in_front
        if session.requests.raised_panel is not None:
            self._layout.bring(session.requests.raised_panel)
            emit("window.panel-raised")
        self._layout.bring_to_front()
