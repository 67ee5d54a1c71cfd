"""The whole user interface of one frame. Reads the session, emits actions; makes no OpenGL call."""

from imgui_bundle import ImVec2, imgui

from viewer.session import Session
from viewer.ui.annotations import draw_block, draw_help, draw_hints, draw_labels, draw_toasts
from viewer.ui.compare_panel import draw_compare_panel
from viewer.ui.divergence_panel import draw_divergence_panel
from viewer.ui.facts import Emit, FrameFacts
from viewer.ui.items import ItemPlaces
from viewer.ui.picture_input import PictureInput
from viewer.ui.scene_panel import OpenField, draw_scene_panel
from viewer.ui.timings_panel import draw_timings_panel

PANEL_WIDTH = 380.0
EDGE = 8.0
PANELS_TOP = 36.0


def _scene_panel_height(window: float) -> float:
    """Leaves room below for the panel Divergence."""
    return min(max(window - 600.0, 120.0), 360.0)


class UserInterface:
    """Panels, annotations and input over the picture."""

    def __init__(self) -> None:
        self.items = ItemPlaces()
        self._input = PictureInput()
        self._open_field = OpenField()

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
            draw_hints(session, size)
        if session.show_help:
            draw_help(session, size, self.items)
        draw_toasts(session.toasts, size)
        self._input.handle(session, size, emit, keys=not list_is_open)

    def _panels(self, session: Session, facts: FrameFacts, size: tuple[float, float], emit: Emit) -> None:
        first = imgui.Cond_.first_use_ever
        right = size[0] - PANEL_WIDTH - EDGE
        imgui.set_next_window_bg_alpha(0.88)
        imgui.set_next_window_pos(ImVec2(EDGE, 36), first)
        imgui.set_next_window_size(ImVec2(PANEL_WIDTH, 356), first)
        if imgui.begin("Compare")[0]:
            draw_compare_panel(session, facts, emit, self.items)
        imgui.end()
        imgui.set_next_window_bg_alpha(0.88)
        imgui.set_next_window_pos(ImVec2(max(EDGE, right), PANELS_TOP), first)
        imgui.set_next_window_size(ImVec2(PANEL_WIDTH, _scene_panel_height(size[1])), first)
        if imgui.begin("Scene")[0]:
            draw_scene_panel(session, self._open_field, emit, self.items)
        imgui.end()
        if session.view.overlay.kind != "none":
            self._divergence(session, facts, size, emit)
        imgui.set_next_window_bg_alpha(0.88)
        imgui.set_next_window_pos(ImVec2(EDGE, 400), first)
        imgui.set_next_window_size(ImVec2(PANEL_WIDTH, 270), first)
        imgui.set_next_window_collapsed(size[1] < 640.0, first)
        opened = imgui.begin("Timings")[0]
        self.items.note("Timings")
        if opened:
            draw_timings_panel(facts)
        imgui.end()

    def _divergence(self, session: Session, facts: FrameFacts, size: tuple[float, float], emit: Emit) -> None:
        first = imgui.Cond_.first_use_ever
        top = PANELS_TOP + _scene_panel_height(size[1]) + EDGE
        height = max(240.0, size[1] - top - 40.0)
        imgui.set_next_window_bg_alpha(0.88)
        imgui.set_next_window_pos(ImVec2(max(EDGE, size[0] - PANEL_WIDTH - EDGE), top), first)
        imgui.set_next_window_size(ImVec2(PANEL_WIDTH, height), first)
        if imgui.begin("Divergence")[0]:
            draw_divergence_panel(session, facts, emit, self.items)
        imgui.end()
