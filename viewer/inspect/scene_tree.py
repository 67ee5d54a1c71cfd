"""Rows of the scene's list of nodes, with the instances of expanded nodes. The list may be long."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from viewer.scene.json_text import counted
from viewer.scene.model import Material, Scene


@dataclass(frozen=True)
class TreeRow:
    """Row of the list: a node, or below it one of its instances."""

    label: str
    node: int
    instance: int
    """Number of the instance; -1 for the node itself."""
    texture_id: int
    """Texture of the instance; -1 for none, and for nodes."""


class SceneTree:
    """Rows of the nodes that have instances. There may be 10^5 rows, therefore the text of a row is made on access."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        nodes = scene.instances.node.astype(np.int64)
        self._by_node: NDArray[np.int64] = np.argsort(nodes, kind="stable")
        self._nodes, self._first, self._counts = np.unique(nodes[self._by_node], return_index=True, return_counts=True)
        self._names = [self._node_name(int(node)).casefold() for node in self._nodes]
        self._expanded: set[int] = set()
        self._places: NDArray[np.int64] = np.arange(len(self._nodes))
        self._row_place: NDArray[np.int64] = np.zeros(0, np.int64)
        self._row_number: NDArray[np.int64] = np.zeros(0, np.int64)
        self._arrange()

    def _node_name(self, node: int) -> str:
        names = self._scene.node_names
        return (names[node] if 0 <= node < len(names) else "") or f"node {node}"

    @property
    def node_count(self) -> int:
        """Number of nodes that pass the filter."""
        return len(self._places)

    def filter(self, text: str) -> None:
        """List only nodes whose name, or a mesh or material below, contains each word of `text`."""
        words = text.casefold().split()
        if not words:
            self._places = np.arange(len(self._nodes))
        else:
            # Names of primitives and materials repeat in many instances: each is searched once.
            described = [
                f"{primitive.name} {self._scene.materials[primitive.material].name}".casefold()
                for primitive in self._scene.primitives
            ]
            primitives = self._scene.instances.primitive[self._by_node]
            fits = np.ones(len(self._nodes), bool)
            for word in words:
                in_primitive = np.array([word in text for text in described], bool)
                named = np.array([word in name for name in self._names], bool)
                below = in_primitive[primitives] if len(primitives) else np.zeros(0, bool)
                some = np.logical_or.reduceat(below, self._first) if len(below) else np.zeros(len(named), bool)
                fits &= named | some
            self._places = np.nonzero(fits)[0]
        self._arrange()

    def toggle(self, node: int) -> None:
        """Expand or collapse a node."""
        self._expanded ^= {node}
        self._arrange()

    def is_expanded(self, node: int) -> bool:
        """Return True where a node's instances are rows."""
        return node in self._expanded

    def _arrange(self) -> None:
        expanded = np.isin(self._nodes[self._places], list(self._expanded))
        lengths = 1 + np.where(expanded, self._counts[self._places], 0)
        ends = np.cumsum(lengths)
        self._row_place = np.repeat(self._places, lengths)
        self._row_number = np.arange(int(ends[-1]) if len(ends) else 0) - np.repeat(ends - lengths, lengths) - 1

    def __len__(self) -> int:
        return len(self._row_place)

    def __getitem__(self, index: int) -> TreeRow:
        place, number = int(self._row_place[index]), int(self._row_number[index])
        node = int(self._nodes[place])
        if number < 0:
            count = int(self._counts[place])
            return TreeRow(f"{self._node_name(node)} ({count})", node, -1, -1)
        instance = int(self._by_node[int(self._first[place]) + number])
        primitive = self._scene.primitives[int(self._scene.instances.primitive[instance])]
        material = self._scene.materials[primitive.material]
        label = f"{primitive.name or 'primitive'}, {counted(primitive.index_count // 3, 'triangle')}, {material.name or 'material'}"
        return TreeRow(label, node, instance, material.texture_id)


def material_text(number: int, material: Material, scene: Scene) -> str:
    """Return a line about a material: its number, name, texture, factor and further maps."""
    texture = scene.textures[material.texture_id].name if material.texture_id >= 0 else "no texture"
    extras: list[str] = [material.alpha_mode] if material.alpha_mode != "opaque" else []
    extras += ["double-sided"] if material.double_sided else []
    planes = (plane for plane in (material.surface, material.emission) if plane is not None)
    extras += [name for plane in planes for name in plane.maps]
    factor = (
        ""
        if all(value == 1.0 for value in material.factor)
        else " x (" + ", ".join(f"{value:.2f}" for value in material.factor) + ")"
    )
    return f"{number}  {material.name or 'material'}: {texture}{factor}" + (f", {', '.join(extras)}" if extras else "")
