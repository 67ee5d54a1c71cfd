"""Mouse and keys over the picture: moving the camera and the divider."""

import math

from imgui_bundle import imgui

from viewer.commands.keys import HOLD_KEY
from viewer.jobs.background import Background
from viewer.state import navigation
from viewer.state.compare_layout import WIPES, window_to_image
from viewer.state.session import Session
from viewer.ui.facts import Emit
from viewer.ui.flight import Flight
from viewer.ui.keyboard import imgui_key, run_commands
from viewer.ui.widgets import Area

GRAB_WIDTH = 12.0
"""Units of normal scale on either side of the divider within which it can be grabbed."""
CLICK_DISTANCE = 4.0
"""Window units: a press that moves less is a click."""
SUN_DEGREES = 180.0
"""That a drag over the picture's height moves the sun by."""


class PictureInput:
    """Remembers what a drag began on."""

    def __init__(self, background: Background) -> None:
        self._dragging_divider = False
        self._pressed_at: tuple[float, float] | None = None
        self.flight = Flight(background)

    def handle(self, session: Session, area: Area, emit: Emit, keys: bool = True) -> None:
        """Run commands for this frame's events on the picture in `area`; `keys` False leaves those of commands to an open list."""
        io = imgui.get_io()
        if keys:
            run_commands(session, emit, typing=io.want_text_input)
        if keys and not io.want_text_input:
            self._camera_keys(session, emit)
        held = not io.want_text_input and imgui.is_key_down(imgui_key(HOLD_KEY))
        if held != session.window.show_other:
            emit("compare.show-other", held)
        self.flight.handle(session, emit, typing=io.want_text_input)
        self._mouse(session, area, io, emit)

    def _camera_keys(self, session: Session, emit: Emit) -> None:
        for number, camera in enumerate(session.scene.cameras[:9]):
            if imgui.is_key_pressed(getattr(imgui.Key, f"_{number + 1}"), repeat=False):
                emit("camera.set", camera)

    @staticmethod
    def _near_divider(session: Session, area: Area, at: tuple[float, float]) -> bool:
        if session.view.compare not in WIPES:
            return False
        axis, position = 0 if session.view.compare == "wipe" else 1, session.view.wipe_position
        return abs(at[axis] - area.at(position, position)[axis]) <= GRAB_WIDTH * imgui.get_style().font_scale_dpi

    def _mouse(self, session: Session, area: Area, io: imgui.IO, emit: Emit) -> None:
        left = imgui.MouseButton_.left
        if not imgui.is_mouse_down(left):
            self._dragging_divider = False
        if io.want_capture_mouse and not self._dragging_divider:
            self._pressed_at = None
            self._hover(session, None, emit)
            return
        share = area.share_of(io.mouse_pos.x, io.mouse_pos.y)
        inside = all(0.0 <= value < 1.0 for value in share)
        self._hover(session, window_to_image(session.shown_view, *share) if inside else None, emit)
        across = session.view.compare == "wipe-horizontal"
        near = self._near_divider(session, area, (io.mouse_pos.x, io.mouse_pos.y))
        if near:
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ns if across else imgui.MouseCursor_.resize_ew)
            if imgui.is_mouse_double_clicked(left):
                emit("compare.divider")
                return
            if imgui.is_mouse_clicked(left):
                self._dragging_divider = True
        if self._dragging_divider:
            if io.mouse_delta.y if across else io.mouse_delta.x:
                emit("compare.divider", share[1] if across else share[0])
            return
        self._click(session, io, emit)
        if io.key_ctrl:
            self._magnify(session, area, io, emit)
            return
        self._move_camera(session, area.height, io, emit)

    @staticmethod
    def _hover(session: Session, at: tuple[float, float] | None, emit: Emit) -> None:
        if at != session.inspection.hovered:
            emit("picture.hover", at)

    def _click(self, session: Session, io: imgui.IO, emit: Emit) -> None:
        """A press without a drag keeps the block or pixel under the mouse in its panel, where that is open."""
        if imgui.is_mouse_clicked(imgui.MouseButton_.left):
            self._pressed_at = (io.mouse_pos.x, io.mouse_pos.y)
        if imgui.is_mouse_released(imgui.MouseButton_.left) and self._pressed_at is not None:
            still = math.dist(self._pressed_at, (io.mouse_pos.x, io.mouse_pos.y)) < CLICK_DISTANCE
            if still and session.view.overlay.kind == "divergence":
                emit("block.keep-at", session.inspection.hovered)
            if still and "Pixel" in session.window.open_panels:
                emit("pixel.keep-at", session.inspection.hovered)
            self._pressed_at = None

    def _magnify(self, session: Session, area: Area, io: imgui.IO, emit: Emit) -> None:
        zoom = session.view.zoom
        if io.mouse_wheel:
            zoom = zoom.towards(*area.share_of(io.mouse_pos.x, io.mouse_pos.y), io.mouse_wheel)
        if imgui.is_mouse_down(imgui.MouseButton_.left):
            zoom = zoom.moved(io.mouse_delta.x / area.width, io.mouse_delta.y / area.height)
        if zoom != session.view.zoom:
            emit("view.zoom", zoom)

    def _move_camera(self, session: Session, height: float, io: imgui.IO, emit: Emit) -> None:
        camera, flies = session.view.camera, session.settings.camera_mode == "fly"
        drag = (io.mouse_delta.x, io.mouse_delta.y)
        if drag != (0.0, 0.0):
            if imgui.is_mouse_down(imgui.MouseButton_.left) and io.key_shift and session.view.material_view == "lit":
                emit("light.move-sun", SUN_DEGREES * drag[0] / height, -SUN_DEGREES * drag[1] / height)
            elif imgui.is_mouse_down(imgui.MouseButton_.left):
                camera = navigation.look(camera, drag, height) if flies else navigation.orbit(camera, drag, height)
            elif imgui.is_mouse_down(imgui.MouseButton_.right) or imgui.is_mouse_down(imgui.MouseButton_.middle):
                camera = navigation.pan(camera, drag, height)
        if io.mouse_wheel:
            if flies:
                emit("camera.fly-faster", io.mouse_wheel)
            else:
                camera = navigation.zoom(camera, io.mouse_wheel)
        if camera != session.view.camera:
            emit("camera.set", camera)
