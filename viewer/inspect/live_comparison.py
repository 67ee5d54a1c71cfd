"""Work while the picture is at rest: draw the hidden slot, compile programs, and compare A with B."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.worker.helpers import HELPERS
from viewer.inspect.comparison import Comparison, LiveFigures, PicturePair, compare, compared_source
from viewer.jobs.job import Job, JobReport
from viewer.render.compositor import ComparisonErrors
from viewer.render.frames import DrawnPair
from viewer.render.renderer import Renderer
from viewer.state.view_state import Slot, ViewState

REST_SECONDS = 0.3
"""Time in seconds without a change of camera and slots after which a picture is at rest."""


def _errors(comparison: Comparison, decoders: tuple[int, ...]) -> ComparisonErrors:
    by_texture = np.full(len(decoders), np.nan, np.float32)
    for row in comparison.textures:
        by_texture[row.number] = row.rmse
    decoder_errors = {row.number: row.rmse for row in comparison.decoders}
    by_decoder = np.array([decoder_errors.get(decoder, np.nan) for decoder in decoders], np.float32)
    return ComparisonErrors(by_texture, by_decoder)


@dataclass(frozen=True, eq=False)
class _Request:
    """Comparison under way, or finished."""

    key: object
    """Key of the pair of pictures."""
    source: str
    decoders: tuple[int, ...]
    renderer: Renderer


class LiveComparison:
    """Comparison in steps of one decode or one read-back, so that no frame waits for long. All calls are on the OpenGL thread.

    A separate process compares the pictures, because FLIP holds Python's interpreter lock and would stop the frames.
    """

    def __init__(self) -> None:
        self._job: Job[Comparison] | None = None
        """Job of the comparison, until its result is taken."""
        self._rest_key: object = None
        self._rested_since = 0.0
        self._done: object = None
        """`_rest_key`, and whether figures were wanted, of the picture for which all work is done."""
        self._renderer: Renderer | None = None
        self._packs: Mapping[str, Pack] | None = None
        self._slots: tuple[Slot, Slot] | None = None
        """Slots of the figures."""
        self._request: _Request | None = None
        """Comparison under way, or the last one."""
        self.figures = LiveFigures()

    def note(
        self, renderer: Renderer, view: ViewState, packs: Mapping[str, Pack], window: tuple[int, int], now: float
    ) -> None:
        """Record which view is shown in a window of `window` (width, height) pixels, and drop figures of other slots."""
        key = (renderer, view.camera, window, view.slot_a, view.slot_b, view.anisotropy)
        if key != self._rest_key or packs is not self._packs:
            self._packs, self._done = packs, None
            self._rest_key, self._rested_since = key, now
        if renderer is not self._renderer or (view.slot_a, view.slot_b) != self._slots:
            renderer.errors.set_errors(None)
            self.figures = LiveFigures()
            self._request = None
        self._renderer, self._slots = renderer, (view.slot_a, view.slot_b)
        is_current = self._request is not None and renderer.pair_key() == self._request.key
        self.figures = replace(
            self.figures,
            is_current=is_current and not self.is_computing and self.figures.comparison is not None,
            computing=self.is_computing and is_current,
        )

    @property
    def is_computing(self) -> bool:
        """True while a comparison is under way, or its result is not yet taken."""
        return self._job is not None

    def is_pending(self, wanted: bool) -> bool:
        """Return True where `step` will have work as soon as the picture is at rest or the comparison has ended."""
        return self._job is not None or (self._rest_key, wanted) != self._done

    def has_work(self, wanted: bool, now: float) -> bool:
        """Return True where `step` has work now."""
        if self._job is not None:
            return self._job.done
        return now - self._rested_since >= REST_SECONDS and (self._rest_key, wanted) != self._done

    def step(self, view: ViewState, wanted: bool, now: float) -> bool:
        """Do the next step, after `note`; `wanted`: figures are shown. Returns True where the picture must be composed again."""
        renderer = self._renderer
        if renderer is None:
            return False
        if self._job is not None and self._job.done:
            job, self._job = self._job, None
            return self._take(renderer, job)
        if now - self._rested_since < REST_SECONDS or (self._rest_key, wanted) == self._done:
            return False
        try:
            if renderer.prepare_slots() or renderer.prepare_comparison():
                return False
        except Exception:
            # The error is reported once. The work is tried again only when something changes.
            self._done = (self._rest_key, wanted)
            raise
        pair = renderer.drawn_pair()
        if (
            wanted
            and pair is not None
            and view.slot_a != view.slot_b
            and (self._request is None or self._request.key != pair.key)
        ):
            if self._job is None:
                self._start(renderer, pair, compared_source(view))
            return False
        self._done = (self._rest_key, wanted)
        return False

    def _start(self, renderer: Renderer, pair: DrawnPair, source: str) -> None:
        self._request = _Request(pair.key, source, renderer.decoders(source), renderer)
        pictures = PicturePair(
            size=pair.a.size,
            a=pair.a.read_bytes(),
            b=pair.b.read_bytes(),
            a_type=pair.a.pixel_type.str,
            b_type=pair.b.pixel_type.str,
            ids=pair.visibility.read_id_bytes(),
            decoders=self._request.decoders,
        )

        def call(report: JobReport) -> Comparison:
            return HELPERS.call("comparison", compare, pictures, report.check)

        self._job = Job(call).start("comparison")

    def _take(self, renderer: Renderer, job: Job[Comparison]) -> bool:
        request = self._request
        if request is None or request.renderer is not renderer or renderer.pair_key() != request.key:
            # The picture has changed meanwhile. The new one is compared when it is at rest.
            self._request = None
            return False
        try:
            result = job.result()
        except InputError as error:
            self.figures = LiveFigures(problem=f"no comparison ({error})", source=request.source)
            return False
        self.figures = LiveFigures(result, True, False, request.source, result.problem)
        renderer.errors.set_errors(_errors(result, request.decoders))
        renderer.errors.set_flip(result.flip_map, request.key)
        return True

    def close(self) -> None:
        """End the comparison under way."""
        if self._job is not None:
            self._job.cancel()
