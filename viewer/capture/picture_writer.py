"""Pictures, films and recorded paths as files in the session's folder of pictures."""

import time

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.io import numbered_path, write_text
from viewer.capture.film import Film
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ShaderError
from viewer.render.viewport import Viewport
from viewer.scene.cameras_file import cameras_json
from viewer.scene.images import write_png
from viewer.scene.model import Camera
from viewer.state.event_handlers import finish_camera_path, finish_picture, notify
from viewer.state.session import PictureRequest, Session


def read_pixels(framebuffer: moderngl.Framebuffer) -> NDArray[np.uint8]:
    """[H, W, 3] uint8 of a framebuffer, row 0 on top."""
    # The window's own framebuffer goes on saying the size that it was opened with: its viewport is what is shown.
    viewport = framebuffer.viewport
    width, height = viewport[2:]
    pixels = np.frombuffer(framebuffer.read(viewport=viewport, components=3, alignment=1), np.uint8)
    return np.ascontiguousarray(pixels.reshape(height, width, 3)[::-1])


class PictureWriter:
    """Writes the requested pictures and paths when a frame is on its framebuffer. What fails becomes a message."""

    def __init__(self, context: GraphicsContext, session: Session, picture: Viewport) -> None:
        self._context, self._session, self._picture = context, session, picture
        self._film: Film | None = None

    def write_requested(self, framebuffer: moderngl.Framebuffer) -> None:
        """Write all that is requested. Raises ContextLostError; what has not been written stays requested then."""
        session = self._session
        self._follow_film(framebuffer)
        for request in session.requests.pictures:
            self._write(request, framebuffer)
            finish_picture(session)
        if session.requests.camera_path is not None:
            self._write_path(session.requests.camera_path)
            finish_camera_path(session)

    def _write(self, request: PictureRequest, framebuffer: moderngl.Framebuffer) -> None:
        session, is_window = self._session, request.kind == "window"
        dated = session.dated_file("" if is_window else f"-{request.kind}", ".png")
        path = session.pictures_folder / request.file if request.file else dated
        # Scripts say exactly which file they mean, and write it anew each time that they are played.
        path = path if request.quiet else numbered_path(path)
        try:
            size = session.window.picture_size
            pixels = read_pixels(framebuffer) if is_window else self._picture.alone(request, size)
            self._context.reset.check()
            write_png(path, pixels)
            if not request.quiet:
                notify(session, f"wrote {path}")
        except (InputError, ShaderError, moderngl.Error, MemoryError) as error:
            line = " ".join(str(error).split()) or "out of memory while writing the picture"
            notify(session, line, "error")

    def _follow_film(self, framebuffer: moderngl.Framebuffer) -> None:
        """Begin, go on with, or end the film that is requested."""
        wanted, film, now = self._session.requests.film, self._film, time.monotonic()
        path = self._session.pictures_folder / wanted if wanted is not None else None
        if film is not None and film.path != path:
            self.end_film()
        if path is not None:
            self._film = self._film or Film(path)
            if self._film.wants(now):
                self._film.add(read_pixels(framebuffer), now)

    def end_film(self) -> None:
        """Write the film that is being taken, if one is."""
        film, self._film = self._film, None
        if film is None:
            return
        try:
            count = film.write()
            notify(self._session, f"wrote {film.path}: {count} pictures")
        except (InputError, OSError, MemoryError) as error:
            notify(self._session, f"{film.path}: cannot be written ({error})", "error")

    def _write_path(self, cameras: tuple[Camera, ...]) -> None:
        path = self._session.dated_file("-path", ".json")
        try:
            write_text(path, cameras_json(cameras))
            line = f"wrote {len(cameras)} cameras to {path}: encode --grouping covisible --views takes it"
            notify(self._session, line)
        except InputError as error:
            notify(self._session, str(error), "error")
