"""Flying with held keys: as fast as what is near the eye is far away, which the picture says while it changes."""

import time

from imgui_bundle import ImVec2, imgui

from viewer.jobs.background import Background
from viewer.scene.model import Scene
from viewer.scene.surface_samples import SurfaceSamples
from viewer.state import navigation
from viewer.state.session import Session
from viewer.ui.facts import Emit
from viewer.ui.keyboard import imgui_key
from viewer.ui.widgets import Area, WidgetRects, packed

MOVES = {"w": (0, 0, 1), "s": (0, 0, -1), "a": (-1, 0, 0), "d": (1, 0, 0), "e": (0, 1, 0), "q": (0, -1, 0)}
LONGEST_STEP = 0.1
"""Seconds: a slow frame must not throw the camera across the scene."""
SHOWN_SECONDS = 1.5
"""The speed is shown for so long after it was used or changed."""
SHOWN_AT = 0.3
"""Share of the picture's height."""
PLATE = (0.0, 0.0, 0.0, 0.65)
TEXT = (1.0, 1.0, 1.0, 0.9)


class Flight:
    """Remembers what surfaces the scene has, and what the picture says of the speed."""

    def __init__(self, background: Background) -> None:
        self._background = background
        self._scene: Scene | None = None
        self._samples: SurfaceSamples | None = None
        self._text = ""
        self._until = 0.0
        """Monotonic time at which the text goes."""
        self._notches: float | None = None

    @property
    def is_ending(self) -> bool:
        """Whether a text is on screen that should be gone."""
        return bool(self._text) and time.monotonic() > self._until

    def speed(self, session: Session, fast: bool = False) -> float:
        """Scene units a second."""
        near = self._near(session)
        return navigation.fly_speed(session.scene.bounds, near, session.navigation.speed_notches, fast)

    def _near(self, session: Session) -> float:
        """Distance of the eye to what is nearest; nothing for the moment in which that is not known yet."""
        scene = session.scene
        if self._scene is not scene:
            self._scene, self._samples = scene, None
        if self._samples is None:
            job = self._background.submit(("surfaces", id(scene)), lambda _report: SurfaceSamples(scene))
            self._samples = job.result() if job.done else None
        return self._samples.distance(session.view.camera.eye) if self._samples is not None else 0.0

    def handle(self, session: Session, emit: Emit, typing: bool) -> None:
        """Move the camera while keys are held; nothing while a field is `typing` into."""
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
        """The speed, in the upper part of the picture in `area`: below labels and questions, above cards and messages."""
        if self.is_ending:
            self._text = ""
        if not self._text:
            return
        size = imgui.calc_text_size(self._text)
        middle, y = area.at(0.5, SHOWN_AT)
        x = middle - size.x / 2.0
        draw = imgui.get_background_draw_list()
        draw.add_rect_filled(ImVec2(x - 6, y - 3), ImVec2(x + size.x + 6, y + size.y + 3), packed(PLATE), 4.0)
        draw.add_text(ImVec2(x, y), packed(TEXT), self._text)
        rects.note_rectangle(self._text, x, y, x + size.x, y + size.y)

    def _say(self, speed: float, notches: float) -> None:
        factor = "" if not notches else f" ({navigation.FASTER_STEP**notches:.2g} x the usual)"
        self._text = f"flying {speed:.2g} units a second{factor}"
        self._until = time.monotonic() + SHOWN_SECONDS
