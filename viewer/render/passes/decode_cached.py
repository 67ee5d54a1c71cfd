"""Decode path `cached` over several frames: when tiles are requested, decoded and drawn.

In the simplest frame, `_draw` requests the tiles of the view, decodes what the time budget allows, and draws; missing tiles show
coarser ones. Drawing costs as much as decoding many tiles. So while a view rests, frames first decode ahead, up to FRAMES_AHEAD of
them, and keep the old picture; then the picture is drawn in BANDS parts, one in each frame. Frames that do not wait for the GPU
work on the answer to an earlier request, and request again as soon as it has arrived (docs/explanation/decode-paths.md#cached).
"""

from dataclasses import replace

from viewer.gl.timer import PassTimer
from viewer.render.pass_scheduler import Budget, Pending, Progress, RenderPass, Step
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.tile_cache.budget import TileBudget, TileCounts
from viewer.render.resources.tile_cache.cache import TileCache
from viewer.render.resources.visibility_buffer import VisibilityInputs

BANDS = 4
"""Number of parts in which a picture is redrawn over several frames, while the old picture is shown."""
FRAMES_AHEAD = 12
"""Number of frames that only decode and keep the old picture, if all tiles are there in an older version."""
FRAMES_AHEAD_OF_MISSING = 4
"""Number of such frames if tiles are missing and frames are slow."""


class DecodeCachedPass(RenderPass[VisibilityInputs, ColorTarget]):
    """Pass of path `cached` for one pack. A view is complete once no tile is waiting and no band is left."""

    name = "decode_cached"

    def __init__(self, cache: TileCache, timer: PassTimer, budget: TileBudget) -> None:
        self.cache = cache
        """Tile cache that the path draws from."""
        self._timer, self._budget = timer, budget
        self._requested: VisibilityInputs | None = None
        """View whose tiles were requested last."""
        self._is_unrequested = False
        """True if the last view is not requested yet, because an earlier request is unanswered."""
        self._frames_ahead = 0
        """Number of frames since the last drawing that decoded tiles."""
        self._bands_left = 0
        """Number of bands of the picture that the next frames draw."""

    @property
    def tiles(self) -> TileCounts:
        """State of the tile cache; `waiting` is at least 1 while tiles are not drawn or not requested yet."""
        counts = self.cache.counts
        undrawn = bool(self._frames_ahead or self._bands_left or self._is_unrequested)
        return replace(counts, waiting=max(counts.waiting, 1)) if undrawn else counts

    def advance(self, inputs: VisibilityInputs, target: ColorTarget, step: Step) -> Progress:
        """Request, decode and draw tiles: a frame's share, or all for a whole picture."""
        again = step.is_same_view and not step.budget.is_whole
        if again and self._decodes_ahead(step.budget):
            return Progress(False, self._pending())
        self._draw(inputs, target, step.budget, again)
        # Reported as a change only when all bands are drawn.
        return Progress(not self._bands_left, self._pending())

    def _pending(self) -> tuple[Pending, ...]:
        waiting = self.tiles.waiting
        return (Pending("tiles", waiting),) if waiting else ()

    def _decodes_ahead(self, budget: Budget) -> bool:
        """Decode tiles without drawing if that is due; return False when drawing is due.

        It is due if only older versions are shown, or if tiles are missing and frames are slow. One drawing serves several frames.
        """
        if self._bands_left:
            return False
        if not budget.waits:
            self.cache.answer(waits=False)
        most = FRAMES_AHEAD if self.cache.only_stale else 0
        if self.cache.is_missing_tiles and self._budget.is_tight:
            most = FRAMES_AHEAD_OF_MISSING
        if self._frames_ahead >= most:
            # Before a request is answered, there is nothing new to show.
            return self.cache.is_pending and not (self.cache.has_work or self._frames_ahead)
        self._frames_ahead += 1
        self._decode(self.cache.tiles_ahead())
        return True

    def _draw(self, inputs: VisibilityInputs, target: ColorTarget, budget: Budget, again: bool) -> None:
        """Request, decode and draw tiles; all missing ones for a whole picture.

        `again`: `target` shows an older picture of this view, so it may be drawn in bands.
        """
        # Bands follow only after frames that decoded ahead. Otherwise each frame should improve the whole picture.
        undrawn = bool(self._frames_ahead or self._bands_left)
        in_bands = again and self._requested == inputs and undrawn
        if in_bands and self._bands_left:
            self._sample_band(inputs, target)
            return
        self._bands_left = 0
        if self._requested != inputs:
            self.cache.retry_coarse()
        if budget.waits:
            self._decode_requested(inputs, budget.is_whole)
        else:
            self._decode_known(inputs)
        if in_bands:
            self._bands_left = BANDS
            self._sample_band(inputs, target)
            return
        self.cache.sample(inputs, target)

    def _decode_requested(self, inputs: VisibilityInputs, whole: bool) -> None:
        """Request the view's tiles, wait for the answer, and decode the missing ones, or a frame's share."""
        self._is_unrequested = False
        while True:
            if self._requested != inputs or self.cache.request_overflowed:
                self.cache.request(inputs)
                self.cache.answer(waits=True)
                self._requested = inputs
            elif self.cache.is_pending:
                self.cache.answer(waits=True)
            count = 0 if self._frames_ahead and not whole else self.cache.tiles_now(whole)
            self._frames_ahead = 0
            if count:
                self._decode(count)
            if not (whole and count and self.cache.request_overflowed):
                return

    def _decode_known(self, inputs: VisibilityInputs) -> None:
        """Decode a frame's share of the missing tiles of the last answer, and request this view's tiles. Never waits."""
        self.cache.answer(waits=False)
        count = 0 if self._frames_ahead else self.cache.tiles_now(whole=False)
        self._frames_ahead = 0
        if count:
            self._decode(count)
        self.cache.decode_first(inputs)
        is_new = self._requested != inputs or self.cache.request_overflowed
        self._is_unrequested = is_new and self.cache.is_pending
        if is_new and not self._is_unrequested:
            self.cache.request(inputs)
            self._requested = inputs

    def _decode(self, count: int) -> None:
        """Decode waiting tiles; if frames have a time limit, also measure the time per tile."""
        if self._budget.milliseconds is None:
            self.cache.decode(count)
            return
        done = 0

        def note(milliseconds: float) -> None:
            self.cache.note_time(done, milliseconds)

        with self._timer.watch(note):
            done = self.cache.decode(count)

    def _sample_band(self, inputs: VisibilityInputs, target: ColorTarget) -> None:
        """Draw the next band."""
        band = (BANDS - self._bands_left, BANDS)
        self._bands_left -= 1
        self.cache.sample(inputs, target, band)
