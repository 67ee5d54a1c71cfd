"""Input over the picture: the camera, the divider, flight by held keys, and the keys of commands."""

import math
import time

from imgui_bundle import ImVec2, imgui

from viewer.commands import COMMANDS, bindings
from viewer.commands.keys import HOLD_KEY, Chord
from viewer.jobs.job import Background
from viewer.scene.model import Scene
from viewer.scene.surface_samples import SurfaceSamples
from viewer.state import navigation
from viewer.state.compare_layout import WIPES, window_to_image
from viewer.state.session import Session
from viewer.ui.facts import Emit
from viewer.ui.widgets import Area, WidgetRects, draw_plate

_IMGUI_NAMES = {
    "PageUp": "page_up",
    "PageDown": "page_down",
    "Up": "up_arrow",
    "Down": "down_arrow",
    "Left": "left_arrow",
    "Right": "right_arrow",
    "/": "slash",
    ",": "comma",
    ".": "period",
    ";": "semicolon",
    "'": "apostrophe",
    "[": "left_bracket",
    "]": "right_bracket",
    "\\": "backslash",
    "-": "minus",
    "=": "equal",
    "`": "grave_accent",
    **{str(digit): f"_{digit}" for digit in range(10)},
}


def imgui_key(name: str) -> imgui.Key:
    """Return ImGui's key for a key name of `viewer.commands.keys`."""
    key: imgui.Key = getattr(imgui.Key, _IMGUI_NAMES.get(name, name.lower()))
    return key


def is_pressed(chord: Chord) -> bool:
    """Return whether the key of `chord` was pressed in this frame, with exactly its modifiers."""
    io = imgui.get_io()
    if (io.key_ctrl, io.key_shift, io.key_alt) != (chord.ctrl, chord.shift, chord.alt):
        return False
    return imgui.is_key_pressed(imgui_key(chord.key), repeat=False)


def run_commands(session: Session, emit: Emit, typing: bool) -> None:
    """Run the commands whose keys were pressed. While the user types into a field, only function keys count."""
    if not typing:
        # Otherwise Tab moves the focus into a field of the focused panel, and later keys are typed into it.
        imgui.internal.set_key_owner(imgui.Key.tab, imgui.get_id("commands"))
    bound = bindings(session.settings.keys)
    for command in COMMANDS:
        chords = bound.chords.get(command.id, ())
        if any(is_pressed(chord) for chord in chords if chord.is_function_key or not typing):
            if command.needs_arguments:
                emit("palette.set", command.id)
            else:
                emit(command.id)


MOVES = {"w": (0, 0, 1), "s": (0, 0, -1), "a": (-1, 0, 0), "d": (1, 0, 0), "e": (0, 1, 0), "q": (0, -1, 0)}
LONGEST_STEP = 0.1
"""Longest time step of flight in seconds, so that a slow frame does not throw the camera across the scene."""
SHOWN_SECONDS = 1.5
"""Seconds for which the speed is shown after the last use or change."""
SHOWN_AT = 0.3
"""Height of the shown speed from the top, as a share of the picture's height."""


class Flight:
    """Flight by held keys. The speed follows the distance to the nearest surface, and is shown while it is used or changed."""

    def __init__(self, background: Background) -> None:
        self._background = background
        self._scene: Scene | None = None
        self._samples: SurfaceSamples | None = None
        self._text = ""
        self._until = 0.0
        """Monotonic time at which the text disappears."""
        self._notches: float | None = None

    @property
    def is_ending(self) -> bool:
        """True where the speed is still shown and its time is over."""
        return bool(self._text) and time.monotonic() > self._until

    def speed(self, session: Session, fast: bool = False) -> float:
        """Return the speed of flight in scene units per second."""
        near = self._near(session)
        return navigation.fly_speed(session.scene.bounds, near, session.navigation.speed_notches, fast)

    def _near(self, session: Session) -> float:
        """Return the distance from the eye to the nearest surface; 0 until it is known."""
        scene = session.scene
        if self._scene is not scene:
            self._scene, self._samples = scene, None
        if self._samples is None:
            job = self._background.submit(("surfaces", id(scene)), lambda _report: SurfaceSamples(scene))
            self._samples = job.result() if job.done else None
        return self._samples.distance(session.view.camera.eye) if self._samples is not None else 0.0

    def handle(self, session: Session, emit: Emit, typing: bool) -> None:
        """Move the camera while keys are held, unless the user is `typing` into a field."""
        io = imgui.get_io()
        notches = session.navigation.speed_notches
        if notches != (notches if self._notches is None else self._notches):
            self._say(self.speed(session), notches)
        self._notches = notches
        held = [move for key, move in MOVES.items() if imgui.is_key_down(imgui_key(key))]
        if typing or not held or io.key_ctrl:
            return
        right, up, forward = (sum(move[axis] for move in held) for axis in range(3))
        speed = self.speed(session, io.key_shift)
        moved = navigation.fly(session.view.camera, (right, up, forward), speed * min(io.delta_time, LONGEST_STEP))
        moved = navigation.kept_in_sight(session.view.camera, moved, session.scene.bounds)
        self._say(speed, notches)
        if moved != session.view.camera:
            emit("camera.set", moved)

    def draw(self, area: Area, rects: WidgetRects) -> None:
        """Draw the speed in the upper part of `area`, below labels and above cards and messages."""
        if self.is_ending:
            self._text = ""
        if not self._text:
            return
        size = imgui.calc_text_size(self._text)
        middle, y = area.at(0.5, SHOWN_AT)
        x = middle - size.x / 2.0
        draw_plate(imgui.get_background_draw_list(), ImVec2(x, y), self._text)
        rects.note_rectangle(self._text, x, y, x + size.x, y + size.y)

    def _say(self, speed: float, notches: float) -> None:
        factor = "" if not notches else f" ({navigation.FASTER_STEP**notches:.2g} x the usual speed)"
        self._text = f"flying {speed:.2g} units per second{factor}"
        self._until = time.monotonic() + SHOWN_SECONDS


GRAB_WIDTH = 12.0
"""Distance from the divider within which it can be grabbed, in units of normal scale."""
CLICK_DISTANCE = 4.0
"""Distance in window units below which a press that moves is still a click."""
SUN_DEGREES = 180.0
"""Degrees that the sun moves in a drag over the picture's height."""


class PictureInput:
    """Mouse and key input over the picture, with the state of a drag."""

    def __init__(self, background: Background) -> None:
        self._dragging_divider = False
        self._pressed_at: tuple[float, float] | None = None
        self.flight = Flight(background)

    def handle(self, session: Session, area: Area, emit: Emit, keys: bool = True) -> None:
        """Run commands for this frame's events on the picture in `area`. `keys`: False while an open list receives the keys."""
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
        """Pin the block or pixel under the mouse in its open panel after a click."""
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
