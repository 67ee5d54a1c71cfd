"""Mouse and keys over the picture: moving the camera and the divider."""

import math

from imgui_bundle import imgui

from viewer.commands import HOLD_KEY
from viewer.state import navigation
from viewer.state.actions import InspectBlock, KeepPixel, MoveDivider, SetCamera, SetZoom
from viewer.state.compare_layout import WIPES, seen_at
from viewer.state.session import Session
from viewer.ui.area import Area
from viewer.ui.facts import Emit
from viewer.ui.keyboard import Keyboard, imgui_key

GRAB_WIDTH = 12.0
"""Window units on either side of the divider within which it can be grabbed."""
CENTRE = 0.5
CLICK_DISTANCE = 4.0
"""Window units: a press that moves less is a click."""
MOVES = {"w": (0, 0, 1), "s": (0, 0, -1), "a": (-1, 0, 0), "d": (1, 0, 0), "e": (0, 1, 0), "q": (0, -1, 0)}
LONGEST_STEP = 0.1
"""Seconds: a slow frame must not throw the camera across the scene."""


class PictureInput:
    """Remembers what a drag began on."""

    def __init__(self) -> None:
        self._keyboard = Keyboard()
        self._dragging_divider = False
        self._speed_notches = 0.0
        self._pressed_at: tuple[float, float] | None = None

    def handle(self, session: Session, area: Area, emit: Emit, keys: bool = True) -> None:
        """Turn this frame's events into actions on the picture in `area`; `keys` False leaves those of commands to an open list."""
        io = imgui.get_io()
        if keys:
            self._keyboard.run_commands(session, emit, typing=io.want_text_input)
        if keys and not io.want_text_input:
            self._camera_keys(session, emit)
        session.showing_other = not io.want_text_input and imgui.is_key_down(imgui_key(HOLD_KEY))
        if not io.want_text_input:
            self._fly(session, io, emit)
        self._mouse(session, area, io, emit)

    def _camera_keys(self, session: Session, emit: Emit) -> None:
        for number in range(9):
            camera = session.camera_numbered(number)
            if camera is not None and imgui.is_key_pressed(getattr(imgui.Key, f"_{number + 1}"), repeat=False):
                emit(SetCamera(camera))

    def _fly(self, session: Session, io: imgui.IO, emit: Emit) -> None:
        held = [move for key, move in MOVES.items() if imgui.is_key_down(imgui_key(key))]
        if not held or io.key_ctrl:
            return
        direction = (sum(m[0] for m in held), sum(m[1] for m in held), sum(m[2] for m in held))
        speed = navigation.fly_speed(session.scene.bounds, self._speed_notches, io.key_shift)
        moved = navigation.fly(session.view.camera, direction, speed * min(io.delta_time, LONGEST_STEP))
        if moved != session.view.camera:
            emit(SetCamera(moved))

    @staticmethod
    def _near_divider(session: Session, area: Area, at: tuple[float, float]) -> bool:
        if session.view.compare not in WIPES:
            return False
        axis, position = 0 if session.view.compare == "wipe" else 1, session.view.wipe_position
        return abs(at[axis] - area.at(position, position)[axis]) <= GRAB_WIDTH

    def _mouse(self, session: Session, area: Area, io: imgui.IO, emit: Emit) -> None:
        left = imgui.MouseButton_.left
        if not imgui.is_mouse_down(left):
            self._dragging_divider = False
        session.hovered = None
        if io.want_capture_mouse and not self._dragging_divider:
            self._pressed_at = None
            return
        share = area.share_of(io.mouse_pos.x, io.mouse_pos.y)
        if all(0.0 <= value < 1.0 for value in share):
            session.hovered = seen_at(session.shown_view, *share)
        across = session.view.compare == "wipe-horizontal"
        near = self._near_divider(session, area, (io.mouse_pos.x, io.mouse_pos.y))
        if near:
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ns if across else imgui.MouseCursor_.resize_ew)
            if imgui.is_mouse_double_clicked(left):
                emit(MoveDivider(CENTRE))
                return
            if imgui.is_mouse_clicked(left):
                self._dragging_divider = True
        if self._dragging_divider:
            if io.mouse_delta.y if across else io.mouse_delta.x:
                emit(MoveDivider(share[1] if across else share[0]))
            return
        self._click(session, io, emit)
        if io.key_ctrl:
            self._magnify(session, area, io, emit)
            return
        self._move_camera(session, area.height, io, emit)

    def _click(self, session: Session, io: imgui.IO, emit: Emit) -> None:
        """A press without a drag keeps what is under the mouse, where a panel is open that says what that is."""
        if imgui.is_mouse_clicked(imgui.MouseButton_.left):
            self._pressed_at = (io.mouse_pos.x, io.mouse_pos.y)
        if imgui.is_mouse_released(imgui.MouseButton_.left) and self._pressed_at is not None:
            still = math.dist(self._pressed_at, (io.mouse_pos.x, io.mouse_pos.y)) < CLICK_DISTANCE
            if still and session.view.overlay.kind == "divergence":
                emit(InspectBlock(session.hovered))
            if still and session.comparing.pixel:
                emit(KeepPixel(session.hovered))
            self._pressed_at = None

    def _magnify(self, session: Session, area: Area, io: imgui.IO, emit: Emit) -> None:
        zoom = session.view.zoom
        if io.mouse_wheel:
            zoom = zoom.towards(*area.share_of(io.mouse_pos.x, io.mouse_pos.y), io.mouse_wheel)
        if imgui.is_mouse_down(imgui.MouseButton_.left):
            zoom = zoom.moved(io.mouse_delta.x / area.width, io.mouse_delta.y / area.height)
        if zoom != session.view.zoom:
            emit(SetZoom(zoom))

    def _move_camera(self, session: Session, height: float, io: imgui.IO, emit: Emit) -> None:
        camera, flies = session.view.camera, session.settings.camera_mode == "fly"
        drag = (io.mouse_delta.x, io.mouse_delta.y)
        if drag != (0.0, 0.0):
            if imgui.is_mouse_down(imgui.MouseButton_.left):
                camera = navigation.look(camera, drag, height) if flies else navigation.orbit(camera, drag, height)
            elif imgui.is_mouse_down(imgui.MouseButton_.right) or imgui.is_mouse_down(imgui.MouseButton_.middle):
                camera = navigation.pan(camera, drag, height)
        if io.mouse_wheel:
            if flies:
                self._speed_notches += io.mouse_wheel
                session.say(f"speed {1.25**self._speed_notches:.2f}x")
            else:
                camera = navigation.zoom(camera, io.mouse_wheel)
        if camera != session.view.camera:
            emit(SetCamera(camera))
