"""Image nodes of materials: finding them, and swapping their original and decoded images."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .program import COMPONENTS

SOCKETS: Mapping[str, tuple[str, ...]] = {
    "base": ("Base Color",),
    "normal": ("Normal",),
    "roughness": ("Roughness",),
    "metalness": ("Metallic",),
    "emissive": ("Emission Color", "Emission"),
}
"""Inputs of the Principled BSDF for each map. Names differ between versions of Blender."""
ORIGINAL, DECODED = "ntc_original", "ntc_decoded"
"""Properties of an image node that hold its two images."""
DEEPEST = 16
"""Nodes that a search follows from a socket."""


def image_of(socket: Any, groups: tuple[Any, ...] = (), deepest: int = DEEPEST) -> tuple[Any, int | None] | None:
    """Return (image node that feeds `socket`, component or None for all), or None if there is no image.

    `groups` are the group nodes around the socket, the outermost first.
    """
    if not socket.is_linked or deepest == 0:
        return None
    link = socket.links[0]
    node = link.from_node
    if node.type == "TEX_IMAGE":
        return (node, None) if node.image is not None else None
    inputs = node.inputs
    if node.type == "GROUP" and node.node_tree is not None:
        ends = [each for each in node.node_tree.nodes if each.type == "GROUP_OUTPUT" and each.is_active_output]
        inputs = [each for end in ends for each in end.inputs if each.identifier == link.from_socket.identifier]
        groups = (*groups, node)
    elif node.type == "GROUP_INPUT" and groups:
        inputs = [each for each in groups[-1].inputs if each.identifier == link.from_socket.identifier]
        groups = groups[:-1]
    for each in inputs:
        source = image_of(each, groups, deepest - 1)
        if source is not None:
            if node.type in ("SEPARATE_COLOR", "SEPRGB"):
                return source[0], list(node.outputs).index(link.from_socket)
            return source
    return None


def image_nodes(material: Any) -> Iterator[tuple[str, Any, int | None]]:
    """Yield (map, image node, component) of a material, also for nodes within groups."""
    if not material.use_nodes:
        return
    for node, groups in _nodes(material.node_tree):
        if node.type != "BSDF_PRINCIPLED":
            continue
        for name, sockets in SOCKETS.items():
            socket = next((node.inputs[key] for key in sockets if key in node.inputs), None)
            source = image_of(socket, groups) if socket is not None else None
            if source is not None:
                yield name, *source


def _nodes(tree: Any, groups: tuple[Any, ...] = ()) -> Iterator[tuple[Any, tuple[Any, ...]]]:
    """Yield the nodes of a tree and of its groups, each with the group nodes around it."""
    for node in tree.nodes:
        yield node, groups
        if node.type == "GROUP" and node.node_tree is not None:
            yield from _nodes(node.node_tree, (*groups, node))


def all_nodes() -> Iterator[Any]:
    """Yield the image nodes that have a decoded image."""
    trees = [material.node_tree for material in bpy.data.materials if material.use_nodes]
    for tree in [*trees, *bpy.data.node_groups]:
        yield from (node for node in tree.nodes if node.get(DECODED) is not None)


def show(decoded: bool) -> None:
    """Switch all image nodes to their decoded or their original images."""
    for node in all_nodes():
        node.image = node[DECODED if decoded else ORIGINAL]


def forget() -> None:
    """Switch to the original images, and remove decoded ones."""
    show(False)
    for node in list(all_nodes()):
        image = node[DECODED]
        del node[DECODED], node[ORIGINAL]
        if image.users == 0:
            bpy.data.images.remove(image)


def _pixels(image: Any) -> np.ndarray:
    values = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)


def _decoded_image(original: Any, parts: tuple[tuple[Path, tuple[int, ...], tuple[int, ...]], ...]) -> Any:
    """Return a copy of `original` with components replaced by those of decoded images. `parts`: (file, from, to)."""
    sources = [bpy.data.images.load(str(path)) for path, _, _ in parts]
    width, height = sources[0].size
    before = original.copy()
    before.scale(width, height)
    values = _pixels(before)
    for source, (_, taken, places) in zip(sources, parts, strict=True):
        values[..., list(places)] = _pixels(source)[..., list(taken)]
        bpy.data.images.remove(source)
    bpy.data.images.remove(before)
    made = bpy.data.images.new(f"{original.name} decoded", width, height, alpha=True)
    made.colorspace_settings.name = original.colorspace_settings.name
    made.alpha_mode = original.alpha_mode
    made.pixels.foreach_set(values.ravel())
    made.update()
    # Packing stores the image in the .blend file.
    made.pack()
    return made


def add_decoded(images: Mapping[tuple[str, str], Path]) -> int:
    """Assign decoded images, by (material, map), to image nodes, next to their originals. Return how many nodes have one."""
    made: dict[Any, Any] = {}
    for material in bpy.data.materials:
        nodes: dict[Any, list[Any]] = {}
        for name, node, component in image_nodes(material):
            if (material.name, name) not in images:
                continue
            taken = COMPONENTS[name]
            places = taken if len(taken) == 3 else (0, 1, 2) if component is None else (component,)
            part = images[material.name, name], taken if len(taken) == 3 else taken * len(places), places
            nodes.setdefault(node, []).append(part)
        for node, parts in nodes.items():
            key = node.image, tuple(parts)
            if key not in made:
                made[key] = _decoded_image(*key)
            node[ORIGINAL], node[DECODED] = node.image, made[key]
    return len(list(all_nodes()))
