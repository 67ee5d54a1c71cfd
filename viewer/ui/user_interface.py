"""The whole user interface of one frame. Reads the session, emits actions; makes no OpenGL call."""

from imgui_bundle import ImVec2, imgui

from viewer.session import Session
from viewer.ui.annotations import draw_block, draw_help, draw_hints, draw_labels, draw_toasts
from viewer.ui.facts import Emit, FrameFacts
from viewer.ui.items import ItemPlaces
from viewer.ui.panels import PanelContext, make_panels
from viewer.ui.picture_input import PictureInput
from viewer.ui.training_panel import EncodeOffer

PANEL_WIDTH = 380.0
EDGE = 8.0
PANELS_TOP = 36.0


class UserInterface:
    """Panels, annotations and input over the picture."""

    def __init__(self) -> None:
        self.items = ItemPlaces()
        self._input = PictureInput()
        self._all_panels = make_panels()
        self._offer = EncodeOffer()

    def draw(self, session: Session, facts: FrameFacts, picture: imgui.ImTextureRef | None, emit: Emit) -> None:
        """Everything between ImGui's new_frame and render. `picture` is an OpenGL texture with row 0 at the bottom."""
        self.items.clear()
        # Asked before the panels: a list that this frame's Escape closes still owns the key.
        list_is_open = imgui.is_popup_open("", imgui.PopupFlags_.any_popup)
        display = imgui.get_io().display_size
        size = (max(display.x, 1.0), max(display.y, 1.0))
        if picture is not None:
            corners = (ImVec2(0, 0), ImVec2(*size), ImVec2(0, 1), ImVec2(1, 0))
            imgui.get_background_draw_list().add_image(picture, *corners)
        draw_labels(session, size, self.items)
        draw_block(session, facts, size)
        if session.show_panels:
            self._panels(session, facts, size, emit)
            self._offer.draw(session, size[0], emit, self.items)
            draw_hints(session, size)
        if session.show_help:
            draw_help(session, size, self.items)
        draw_toasts(session.toasts, size)
        self._input.handle(session, size, emit, keys=not list_is_open)

    def _panels(self, session: Session, facts: FrameFacts, size: tuple[float, float], emit: Emit) -> None:
        first = imgui.Cond_.first_use_ever
        context = PanelContext(session, facts, emit, self.items)
        tops = {"left": PANELS_TOP, "right": PANELS_TOP}
        for panel in self._all_panels:
            height, top = panel.height(size[1]), tops[panel.side]
            tops[panel.side] += height + EDGE
            if not panel.shown(session):
                continue
            left = EDGE if panel.side == "left" else max(EDGE, size[0] - PANEL_WIDTH - EDGE)
            imgui.set_next_window_bg_alpha(0.88)
            imgui.set_next_window_pos(ImVec2(left, top), first)
            imgui.set_next_window_size(ImVec2(PANEL_WIDTH, height), first)
            imgui.set_next_window_collapsed(panel.folded(size[1]), first)
            opened = imgui.begin(panel.title)[0]
            self.items.note(panel.title)
            if opened:
                panel.draw(context)
            imgui.end()
