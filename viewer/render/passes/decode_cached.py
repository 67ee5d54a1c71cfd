"""Decode path `cached` over several frames: when tiles are requested, decoded and drawn."""

from dataclasses import replace

from viewer.gl.timer import PassTimer
from viewer.render.pass_scheduler import Budget, Pending, Progress, RenderPass, Step
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.tile_cache.budget import TileBudget, TileCounts
from viewer.render.resources.tile_cache.cache import TileCache
from viewer.render.resources.visibility_buffer import VisibilityInputs

BANDS = 4
"""Number of parts in which a picture is redrawn while the one before is still shown: none of them makes a frame long."""
FRAMES_AHEAD = 12
"""Number of frames that decode tiles and show the picture before, where all tiles are there in an older version."""
FRAMES_AHEAD_OF_MISSING = 4
"""Number of such frames where tiles are shown coarser, and frames are long."""


class DecodeCachedPass(RenderPass[VisibilityInputs, ColorTarget]):
    """Path `cached` of one pack, over several frames. A view is complete once no tile is waiting and no band is left."""

    name = "decode_cached"

    def __init__(self, cache: TileCache, timer: PassTimer, budget: TileBudget) -> None:
        self.cache = cache
        """Tile cache that the path draws from."""
        self._timer, self._budget = timer, budget
        self._requested: VisibilityInputs | None = None
        """View whose tiles were requested last."""
        self._is_unasked = False
        """True where the last view was not requested, because another request was under way."""
        self._frames_ahead = 0
        """Number of frames that decoded tiles since the last drawing."""
        self._bands_left = 0
        """Number of parts of the picture that the next frames draw."""

    @property
    def tiles(self) -> TileCounts:
        """State of the tile cache; tiles that are decoded but not drawn, or not asked for yet, count as waiting."""
        counts = self.cache.counts
        undrawn = bool(self._frames_ahead or self._bands_left or self._is_unasked)
        return replace(counts, waiting=max(counts.waiting, 1)) if undrawn else counts

    def advance(self, inputs: VisibilityInputs, target: ColorTarget, step: Step) -> Progress:
        """Request, decode and draw tiles, a frame's share of them, or all where the picture is to be whole."""
        again = step.is_same_view and not step.budget.is_whole
        if again and self._decodes_ahead(step.budget):
            return Progress(False, self._pending())
        self._draw(inputs, target, step.budget, again)
        # The picture before is shown until all rows are drawn.
        return Progress(not self._bands_left, self._pending())

    def _pending(self) -> tuple[Pending, ...]:
        waiting = self.tiles.waiting
        return (Pending("tiles", waiting),) if waiting else ()

    def _decodes_ahead(self, budget: Budget) -> bool:
        """Decode tiles without drawing, where all are there in an older version, or frames are long; return False when drawing is due.

        Drawing costs as much as decoding many tiles: the picture is drawn once for several frames that decode.
        """
        if self._bands_left:
            return False
        if not budget.waits:
            self.cache.answer(waits=False)
        most = FRAMES_AHEAD if self.cache.only_stale else 0
        if self.cache.is_missing_tiles and self._budget.is_tight:
            most = FRAMES_AHEAD_OF_MISSING
        if self._frames_ahead >= most:
            # Until a request is answered there is nothing new to show.
            return self.cache.is_pending and not (self.cache.has_work or self._frames_ahead)
        self._frames_ahead += 1
        self._decode(self.cache.tiles_ahead())
        return True

    def _draw(self, inputs: VisibilityInputs, target: ColorTarget, budget: Budget, again: bool) -> None:
        """Request, decode and draw tiles. For a whole picture all missing tiles are decoded.

        Drawn `again`, where `target` shows an older picture of this view, only some rows may be drawn.
        """
        # Only after frames that decoded ahead: else a picture that lacks tiles is to improve in every frame.
        undrawn = bool(self._frames_ahead or self._bands_left)
        in_bands = again and self._requested == inputs and undrawn
        if in_bands and self._bands_left:
            self._sample_band(inputs, target)
            return
        self._bands_left = 0
        if self._requested != inputs:
            self.cache.retry_coarse()
        if budget.waits:
            self._decode_asked(inputs, budget.is_whole)
        else:
            self._decode_known(inputs)
        if in_bands:
            self._bands_left = BANDS
            self._sample_band(inputs, target)
            return
        self.cache.sample(inputs, target)

    def _decode_asked(self, inputs: VisibilityInputs, whole: bool) -> None:
        """Request the view's tiles, and decode those that are missing, or a frame's share of them."""
        self._is_unasked = False
        while True:
            if self._requested != inputs or self.cache.request_overflowed:
                self.cache.request(inputs)
                self.cache.answer(waits=True)
                self._requested = inputs
            elif self.cache.is_pending:
                self.cache.answer(waits=True)
            wanted = 0 if self._frames_ahead and not whole else self.cache.tiles_now(whole)
            self._frames_ahead = 0
            if wanted:
                self._decode(wanted)
            if not (whole and wanted and self.cache.request_overflowed):
                return

    def _decode_known(self, inputs: VisibilityInputs) -> None:
        """Decode a frame's share of the tiles that were missing when a request was answered last, and request this view's."""
        self.cache.answer(waits=False)
        wanted = 0 if self._frames_ahead else self.cache.tiles_now(whole=False)
        self._frames_ahead = 0
        if wanted:
            self._decode(wanted)
        self.cache.decode_first(inputs)
        is_new = self._requested != inputs or self.cache.request_overflowed
        self._is_unasked = is_new and self.cache.is_pending
        if is_new and not self._is_unasked:
            self.cache.request(inputs)
            self._requested = inputs

    def _decode(self, count: int) -> None:
        """Decode waiting tiles. Where a frame has a limit of time, it asks for the time that they took."""
        if self._budget.milliseconds is None:
            self.cache.decode(count)
            return
        done = 0

        def note(milliseconds: float) -> None:
            self.cache.note_time(done, milliseconds)

        with self._timer.watch(note):
            done = self.cache.decode(count)

    def _sample_band(self, inputs: VisibilityInputs, target: ColorTarget) -> None:
        """Draw the next rows."""
        band = (BANDS - self._bands_left, BANDS)
        self._bands_left -= 1
        self.cache.sample(inputs, target, band)
