"""Search for the first view of a scene without cameras.

The window opens with a view of the whole scene. That view shows a town as a speck, and a room as a closed box. Therefore the search
samples places in the background, draws one of them per frame, and moves the camera to the place that shows most textures.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from viewer.jobs.job import Background, Job
from viewer.scene.model import Camera, Scene
from viewer.state.events import EmitEvent, FirstViewFound, Notification
from viewer.state.framing import ALL
from viewer.state.session import Session
from viewer.viewpoints.sampling import (
    Candidate,
    CandidateRenderer,
    CandidateSampler,
    CandidateView,
    DrawTextureIds,
    ViewCriteria,
    ViewpointConfig,
    choose,
)

WALKING, CLOSE, AROUND, INDOORS = 6, 3, 3, 12
"""Numbers of sampled places at eye height, close to surfaces, around the scene, and in rooms. An interior is sampled in its rooms
alone."""
ENOUGH = ViewCriteria(least_covered=0.03, most_of_one=1.0, least_textures=1)
"""Criteria that the view of the whole scene must meet to stay the first view, besides ENOUGH_TEXTURES."""
ENOUGH_TEXTURES = 0.6
"""Share of the scene's textures that the view of the whole scene must show to stay the first view."""
TARGET_DISTANCE = 4.0
"""Distance in eye heights of the point that the chosen camera orbits."""
CONFIG = ViewpointConfig(count=1)


class FirstView:
    """Search for the first view while the session asks for one."""

    def __init__(self, background: Background, emit: EmitEvent) -> None:
        self._background, self._emit = background, emit
        self._scene: Scene | None = None
        self._overview: CandidateView | None = None
        self._waiting: Sequence[Candidate] | None = None
        """Places that are not drawn yet; None until they are sampled."""
        self._indoors = False
        """True where the places are in rooms."""
        self._views: list[CandidateView] = []

    def is_due(self, session: Session) -> bool:
        """Return whether `step` would do something."""
        if not session.seeks_first_view:
            return False
        begun = self._scene is session.scene and self._overview is not None and self._waiting is None
        return not begun or self._job(session.scene).done

    def step(self, session: Session, draw_ids: DrawTextureIds) -> None:
        """Continue the search: draw a few small pictures by `draw_ids`. An error ends the search, and is raised."""
        try:
            self._step(session, draw_ids)
        except BaseException:
            self._emit(FirstViewFound(session.scene, None))
            raise

    def _step(self, session: Session, draw_ids: DrawTextureIds) -> None:
        scene, camera = session.scene, session.view.camera
        if not session.seeks_first_view:
            self._scene = None
            return
        if self._scene is not scene:
            self._scene, self._overview, self._waiting, self._views = scene, None, None, []
        if camera.name != ALL:
            # The user has moved the camera: it stays there.
            self._emit(FirstViewFound(scene, None))
            return
        drawer = CandidateRenderer(draw_ids, CONFIG.size, scene)
        if self._overview is None:
            self._look_at_all(scene, camera, draw_ids)
        elif self._waiting is None:
            job = self._job(scene)
            if job.done:
                self._indoors, self._waiting = (False, []) if job.problem else job.result()
        elif self._waiting:
            self._views += drawer.views(self._waiting[:1])
            self._waiting = self._waiting[1:]
        else:
            best = self._best(scene, drawer)
            if best is None:
                self._emit(Notification(f"no other view shows more of {scene.name} than all of it"))
            self._emit(FirstViewFound(scene, best))

    def _job(self, scene: Scene) -> Job[tuple[bool, list[Candidate]]]:
        return self._background.submit(("first view", id(scene)), lambda _report: _places(scene))

    def _look_at_all(self, scene: Scene, camera: Camera, draw_ids: DrawTextureIds) -> None:
        """End the search where the whole scene shows enough textures; otherwise notify that it continues."""
        extent = float((scene.bounds[1] - scene.bounds[0]).max())
        ids = draw_ids(camera, CONFIG.size)
        self._overview = CandidateView.of(Candidate(camera, extent), ids, len(scene.textures))
        shown = self._overview.textures
        if not scene.textures or (self._overview.meets(ENOUGH) and shown >= ENOUGH_TEXTURES * len(scene.textures)):
            self._emit(FirstViewFound(scene, None))
            return
        self._emit(
            Notification(f"the whole of {scene.name} shows few of its textures; searching for a better first view")
        )

    def _best(self, scene: Scene, drawer: CandidateRenderer) -> Camera | None:
        """Return the camera of the best place; None where no place outdoors covers more of the picture than the whole scene does."""
        shown = 0.0 if self._overview is None or self._indoors else self._overview.covered
        better = [view for view in self._views if view.covered > shown]
        chosen = choose(better, drawer, 1, len(scene.textures)) if better else []
        if not chosen:
            return None
        if self._indoors:
            return replace(chosen[0].camera, name="first view")
        camera, scale = chosen[0].camera, chosen[0].scale
        way = np.array(camera.target) - camera.eye
        target = np.array(camera.eye) + way / np.linalg.norm(way) * TARGET_DISTANCE * scale
        x, y, z = target.tolist()
        return replace(camera, name="first view", target=(x, y, z))


def _places(scene: Scene) -> tuple[bool, list[Candidate]]:
    """Return whether the scene is an interior, and its sampled places; equal scenes give equal places."""
    sampler = CandidateSampler.of(scene, CONFIG)
    if sampler is None:
        return False, []
    if rooms := sampler.indoors(INDOORS):
        return True, rooms
    return False, [*sampler.walking(WALKING), *sampler.close(CLOSE), *sampler.around(AROUND)]
