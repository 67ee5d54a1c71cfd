"""Time left of long work: from a forecast at first, then from the progress that the work makes."""

import math

FORECAST_SHARE = 0.02
"""Share of the work that the forecast counts as, beside the work whose time was measured."""
MEMORY = 0.1
"""Share of the work after which a measured speed counts 1/e as much: other programs begin and end."""
START_SHARE = 0.05
"""Share of the work over which measured speed comes to count: a start takes time of its own."""
LEAST_SHARE = 0.03
"""Share of the work from which on the time left is known without a forecast."""


class TimeLeft:
    """Estimate of the time left of one piece of work. Seconds are of one clock, which may stand still in pauses."""

    def __init__(self, began: float, forecast: float | None = None, done: float = 0.0) -> None:
        """Begin at `began` seconds with `done` of the work, in its unit, done before. `forecast`: expected seconds of the whole work;
        None: unknown."""
        self._forecast = forecast
        self._first = self._done = done
        self._planned = 0.0
        """All work; 0 before it is known."""
        self._changed = began
        """Second at which `_done` was reached."""
        # Seconds, and the share of the work that they took, of which each counts less the longer ago it is.
        self._seconds, self._shares = 0.0, 0.0
        if forecast is not None:
            self._seconds, self._shares = forecast * FORECAST_SHARE, FORECAST_SHARE

    def advance(self, now: float, done: float, planned: float = 1.0) -> None:
        """Take in that `done` of the `planned` work is done at second `now`. The plan may change on the way."""
        if planned <= 0.0:
            return
        if self._planned > 0.0:
            self._shares *= self._planned / planned
        self._planned = planned
        step = (done - self._done) / planned
        if step <= 0.0:
            return
        kept = math.exp(-step / MEMORY)
        counts = 1.0 - math.exp(-(done - self._first) / planned / START_SHARE)
        self._seconds = self._seconds * kept + counts * (now - self._changed)
        self._shares = self._shares * kept + counts * step
        self._done, self._changed = done, now

    def left(self, now: float) -> float | None:
        """Return the seconds left at second `now`; None while nothing is known."""
        # Sums of many parts are off by their rounding.
        if self._planned > 0.0 and self._done >= self._planned * (1.0 - 1e-9):
            return 0.0
        share, first = (done / self._planned if self._planned > 0.0 else 0.0 for done in (self._done, self._first))
        if self._forecast is None and share - first < LEAST_SHARE:
            return None
        whole = self._seconds / self._shares
        return max((1.0 - share) * whole - (now - self._changed), 0.0)
