"""Count of the work of an encoding, some of which is known only when other work is done."""


class WorkCount:
    """Work that is done, and all that is planned now. Its share never falls. Any thread may add work, and plan more or less."""

    def __init__(self) -> None:
        self._plans: list[float] = []
        self._parts: list[float] = []
        self._base = (0.0, 0.0)
        """(share, work done) when the plan changed last."""

    @property
    def planned(self) -> float:
        """Total of the work planned so far."""
        return sum(self._plans)

    @property
    def done(self) -> float:
        """Work that is done."""
        return sum(self._parts)

    def add(self, work: float) -> None:
        """Count work that was done. Appending to a list is atomic."""
        self._parts.append(work)

    def expect(self, work: float) -> None:
        """Plan more work, or less where it is negative: the remaining share is spread over the remaining work."""
        self._base = (self.share, self.done)
        self._plans.append(work)

    @property
    def share(self) -> float:
        """Progress from 0 to 1."""
        share, done = self._base
        left = self.planned - done
        if left <= 0.0:
            return 1.0 if self.planned > 0.0 else 0.0
        return min(1.0, round(share + (1.0 - share) * (self.done - done) / left, 9))
