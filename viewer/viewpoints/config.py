"""How viewpoints are sampled."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ViewpointConfig:
    """How viewpoints are sampled."""

    count: int = 24
    """Most viewpoints returned."""
    seed: int = 0
    candidates_per_view: int = 6
    """Views drawn for each one asked for."""
    size: tuple[int, int] = (160, 90)
    """Width and height in pixels of the pictures that candidates are judged by."""
    fov_degrees: float = 60.0
