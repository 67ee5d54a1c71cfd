"""What is done while the picture rests: the hidden slot is drawn, programs are compiled, and A is compared with B."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ntc.pack.model import Pack
from viewer.inspect.comparison import Comparison, PairOfPictures
from viewer.inspect.comparison_process import ComparisonProcess
from viewer.inspect.live_figures import LiveFigures, compared_source
from viewer.render.error_overlay import ComparisonErrors
from viewer.render.frame_result import DrawnPair
from viewer.render.renderer import Renderer
from viewer.state.view_state import Slot, ViewState

REST_SECONDS = 0.3
"""A picture rests when neither camera nor slots have changed for so long."""


def _errors(comparison: Comparison, decoders: tuple[int, ...]) -> ComparisonErrors:
    by_texture = np.full(len(decoders), np.nan, np.float32)
    for row in comparison.textures:
        by_texture[row.number] = row.rmse
    of_decoder = {row.number: row.rmse for row in comparison.decoders}
    by_decoder = np.array([of_decoder.get(decoder, np.nan) for decoder in decoders], np.float32)
    return ComparisonErrors(by_texture, by_decoder)


@dataclass(frozen=True, eq=False)
class _Asked:
    """A comparison that was begun."""

    key: object
    """Of the pair of pictures."""
    source: str
    decoders: tuple[int, ...]
    started_at: float
    renderer: Renderer


class LiveComparison:
    """Steps of one decode or one read-back each, so that no frame waits for long. Belongs to the OpenGL context's thread."""

    def __init__(self) -> None:
        self._process = ComparisonProcess()
        self._rest_key: object = None
        self._rested_since = 0.0
        self._done: object = None
        """The rest for which everything has been done."""
        self._renderer: Renderer | None = None
        self._packs: Mapping[str, Pack] | None = None
        self._slots: tuple[Slot, Slot] | None = None
        """Of the figures."""
        self._asked: _Asked | None = None
        """What is compared now or was compared last."""
        self.figures = LiveFigures()

    def note(
        self, renderer: Renderer, view: ViewState, packs: Mapping[str, Pack], window: tuple[int, int], now: float
    ) -> None:
        """Take in what is shown, in a window of `window` (width, height) pixels, and drop what is of something else."""
        key = (renderer, view.camera, window, view.slot_a, view.slot_b, view.anisotropy)
        if key != self._rest_key or packs is not self._packs:
            self._packs, self._done = packs, None
            self._rest_key, self._rested_since = key, now
        if renderer is not self._renderer or (view.slot_a, view.slot_b) != self._slots:
            renderer.errors.set_errors(None)
            self.figures = LiveFigures()
            self._asked = None
        self._renderer, self._slots = renderer, (view.slot_a, view.slot_b)
        is_current = self._asked is not None and renderer.pair_key() == self._asked.key
        computing = self._process.busy and is_current
        self.figures = replace(
            self.figures,
            is_current=is_current and not self._process.busy and self.figures.comparison is not None,
            computing=computing,
        )

    @property
    def is_computing(self) -> bool:
        """Whether a comparison is under way."""
        return self._process.busy

    def has_work(self, wanted: bool, now: float) -> bool:
        """Whether a frame is to be drawn for what `step` would do."""
        if self._process.busy:
            return self._process.is_ready
        return now - self._rested_since >= REST_SECONDS and (self._rest_key, wanted) != self._done

    def step(self, view: ViewState, wanted: bool, now: float) -> bool:
        """Do the next thing, after `note`; whether the picture is to be composed again. `wanted`: figures are looked at."""
        renderer = self._renderer
        if renderer is None:
            return False
        if self._process.is_ready:
            return self._take(renderer)
        if now - self._rested_since < REST_SECONDS or (self._rest_key, wanted) == self._done:
            return False
        try:
            if renderer.prepare_slots() or renderer.prepare_comparison():
                return False
        except Exception:
            # Said once, and not tried again before something changes.
            self._done = (self._rest_key, wanted)
            raise
        pair = renderer.drawn_pair()
        if (
            wanted
            and pair is not None
            and view.slot_a != view.slot_b
            and (self._asked is None or self._asked.key != pair.key)
        ):
            if not self._process.busy:
                self._start(renderer, pair, compared_source(view), now)
            return False
        self._done = (self._rest_key, wanted)
        return False

    def _start(self, renderer: Renderer, pair: DrawnPair, source: str, now: float) -> None:
        self._asked = _Asked(pair.key, source, renderer.decoders(source), now, renderer)
        self._process.start(
            PairOfPictures(
                size=pair.a.size,
                a=pair.a.read_bytes(),
                b=pair.b.read_bytes(),
                a_type=pair.a.pixel_type.str,
                b_type=pair.b.pixel_type.str,
                ids=pair.visibility.read_id_bytes(),
                decoders=self._asked.decoders,
            )
        )

    def _take(self, renderer: Renderer) -> bool:
        result, asked = self._process.take(), self._asked
        if asked is None or asked.renderer is not renderer or renderer.pair_key() != asked.key:
            # The picture has changed meanwhile: it is asked for anew when that one rests.
            self._asked = None
            return False
        if not isinstance(result, Comparison):
            self.figures = LiveFigures(problem=result or "", source=asked.source)
            return False
        seconds = time.monotonic() - asked.started_at
        self.figures = LiveFigures(result, True, False, seconds, asked.source, result.problem)
        renderer.errors.set_errors(_errors(result, asked.decoders))
        renderer.errors.set_flip(result.flip_map, asked.key)
        return True

    def close(self) -> None:
        """End the process."""
        self._process.close()
