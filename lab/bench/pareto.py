"""Which of several compromises are worth taking."""

from collections.abc import Sequence


def pareto_front(points: Sequence[tuple[float, float]]) -> tuple[bool, ...]:
    """For each (cost, worth) whether no other point is at least as good in both and better in one; equal points stay together."""

    def beats(other: tuple[float, float], point: tuple[float, float]) -> bool:
        return other != point and other[0] <= point[0] and other[1] >= point[1]

    return tuple(not any(beats(other, point) for other in points) for point in points)
