"""Objects of the scene: shapes by material, and the nodes that show them."""

from collections import defaultdict
from dataclasses import dataclass, field

from assets.build.shapes import Point, Shape


@dataclass
class Placement:
    """A node that shows a shared object."""

    name: str
    translation: Point
    rotation_y: float = 0.0
    scale: Point = (1.0, 1.0, 1.0)


@dataclass
class Model:
    """An object: shapes by material, and where it stands."""

    name: str
    shapes: defaultdict[str, Shape] = field(default_factory=lambda: defaultdict(Shape))
    placements: list[Placement] = field(default_factory=list)

    def __getitem__(self, material: str) -> Shape:
        return self.shapes[material]
