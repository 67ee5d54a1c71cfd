"""The first view of a scene without cameras: the whole scene, and in an interior the room with the longest view.

From outside a room is a closed box. Rooms are found beside the frames.
"""

from dataclasses import replace

from viewer.jobs.job import Background, Job
from viewer.scene.model import Camera, Scene
from viewer.state.events import EmitEvent, FirstViewChosen
from viewer.state.framing import ALL
from viewer.state.session import Session
from viewer.viewpoints.sampling import CandidateSampler, ViewpointConfig


class FirstView:
    """Search for a room while the session asks for a first view."""

    def __init__(self, background: Background, emit: EmitEvent) -> None:
        self._background, self._emit = background, emit
        self._scene: Scene | None = None
        """Scene whose rooms are being found."""

    def is_due(self, session: Session) -> bool:
        """Return whether `step` would do something."""
        return session.seeks_first_view and (self._scene is not session.scene or self._job(session.scene).done)

    def step(self, session: Session) -> None:
        """Begin the search, or report its end."""
        scene = session.scene
        if not session.seeks_first_view:
            return
        self._scene, job = scene, self._job(scene)
        if session.view.camera.name != ALL:
            # The user has moved the camera: it stays there.
            self._emit(FirstViewChosen(scene, None))
        elif job.done:
            self._emit(FirstViewChosen(scene, None if job.problem else job.result()))

    def _job(self, scene: Scene) -> Job[Camera | None]:
        return self._background.submit(("first view", id(scene)), lambda _report: _room(scene))


def _room(scene: Scene) -> Camera | None:
    """Return a camera at eye height in a room of an interior, along its longest free direction; None for other scenes."""
    sampler = CandidateSampler.of(scene, ViewpointConfig(count=1))
    rooms = sampler.indoors(1) if sampler is not None else []
    return replace(rooms[0].camera, name="first view") if rooms else None
