"""The first view of a scene without cameras: all of it, unless a place in it shows much more of its textures.

All of a town is a speck, and a room is a closed box from outside. So while that is on screen, places are sampled beside the
frames and looked from, one a frame.
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
"""Numbers of places at eye height, close to surfaces, around the scene and in rooms that are looked from; where there are rooms, in
them alone."""
ENOUGH = ViewCriteria(least_covered=0.03, most_of_one=1.0, least_textures=1)
"""Criteria that the view of all of the scene must meet to be the first view, besides ENOUGH_TEXTURES."""
ENOUGH_TEXTURES = 0.6
"""Share of the scene's textures that is enough."""
TARGET_DISTANCE = 4.0
"""Distance in eye heights of the point that the found camera turns about."""
CONFIG = ViewpointConfig(count=1)


class FirstView:
    """Search for the first view while the session asks for one."""

    def __init__(self, background: Background, emit: EmitEvent) -> None:
        self._background, self._emit = background, emit
        self._scene: Scene | None = None
        self._overview: CandidateView | None = None
        self._waiting: Sequence[Candidate] | None = None
        """Places still to look from; None until they are known."""
        self._indoors = False
        """Flag: the places are in rooms."""
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
            # Somebody has moved it: where to, is as wanted.
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
        """Stay with all of the scene where that shows enough; else notify that another view is searched for."""
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
        """Return the place that shows most; None where that is outdoors and no more than all of the scene shows."""
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
    """Return whether the scene is an interior, and places to look from, the same for the same scene."""
    sampler = CandidateSampler.of(scene, CONFIG)
    if sampler is None:
        return False, []
    if rooms := sampler.indoors(INDOORS):
        return True, rooms
    return False, [*sampler.walking(WALKING), *sampler.close(CLOSE), *sampler.around(AROUND)]
