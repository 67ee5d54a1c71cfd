"""The gallery: single materials to judge. Spheres of every roughness with and without metalness, some of the courtyard's materials
on spheres and panels, and one sphere for each extension that is read."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assets.build.glb import GlbWriter
from assets.build.gltf_materials import add_textures, material_entry
from assets.build.materials import recipes

SHOWN = ("metal_plates", "floor_checker", "wood_painted_teal", "metal_sign", "floor_terracotta")
GROUND = "concrete_smooth"
GOLD, CLAY = [1.0, 0.77, 0.34, 1.0], [0.7, 0.3, 0.22, 1.0]
STEPS = 7
"""Spheres in a row of the grid, roughness 0 to 1."""
RADIUS, PITCH = 0.4, 0.95
SPECIAL: dict[str, dict[str, Any]] = {
    "clearcoat": {"KHR_materials_clearcoat": {"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.05}},
    "emission": {"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}},
    "high_ior": {"KHR_materials_ior": {"ior": 2.4}},
    "tinted_specular": {"KHR_materials_specular": {"specularColorFactor": [1.0, 0.45, 0.1]}},
    "matt_specular": {"KHR_materials_specular": {"specularFactor": 0.0}},
    "transmission": {"KHR_materials_transmission": {"transmissionFactor": 0.8}},
}
CAMERAS: tuple[dict[str, Any], ...] = (
    {"name": "gallery", "eye": [0.0, 2.1, 6.4], "target": [0.0, 1.6, 0.0], "fov": 52.0},
    {"name": "grid", "eye": [0.0, 2.7, 4.2], "target": [0.0, 2.62, -1.0], "fov": 48.0},
    {"name": "materials", "eye": [-0.6, 1.5, 4.4], "target": [-0.3, 0.6, 1.2], "fov": 52.0},
    {"name": "panels", "eye": [2.6, 1.2, 3.2], "target": [0.2, 0.7, 0.3], "fov": 50.0},
)

Grid = tuple[NDArray[np.float64], ...]
"""Positions, normals, tangents [V, 4], uvs, indices [3 T]."""


def sphere(radius: float, columns: int = 48, rows: int = 24) -> Grid:
    """A ball about the origin. The texture goes round it twice, from the top down once; u runs right seen from outside, and the
    middle of the texture faces +z."""
    turn, rise = np.meshgrid(np.linspace(0, 2 * np.pi, columns + 1), np.linspace(-np.pi / 2, np.pi / 2, rows + 1))
    normals = np.stack([np.cos(rise) * np.sin(turn), np.sin(rise), np.cos(rise) * np.cos(turn)], axis=-1)
    tangents = np.stack([np.cos(turn), 0 * turn, -np.sin(turn), np.ones_like(turn)], axis=-1)
    uvs = np.stack([turn / np.pi + 0.5, 0.5 - rise / np.pi], axis=-1)
    numbers = np.arange(turn.size).reshape(turn.shape)
    a, b, c, d = numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, 1:], numbers[1:, :-1]
    lower, upper = np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)
    # At the poles one of the two triangles is empty.
    indices = np.concatenate([lower[1:].reshape(-1), upper[:-1].reshape(-1)])
    flat = [values.reshape(-1, values.shape[-1]) for values in (normals * radius, normals, tangents, uvs)]
    return (*flat, indices)


def panel(width: float, height: float, repeats: float) -> Grid:
    """An upright rectangle about the origin that faces +z; the texture repeats along its width and keeps its aspect."""
    x, y = np.array([-0.5, 0.5, 0.5, -0.5]) * width, np.array([-0.5, -0.5, 0.5, 0.5]) * height
    positions = np.stack([x, y, 0 * x], axis=-1)
    normals, tangents = np.tile([0.0, 0.0, 1.0], (4, 1)), np.tile([1.0, 0.0, 0.0, 1.0], (4, 1))
    uvs = np.stack([x / width + 0.5, (0.5 - y / height) * height / width], axis=-1) * repeats
    return positions, normals, tangents, uvs, np.array([0, 1, 2, 0, 2, 3])


def add_camera(writer: GlbWriter, camera: dict[str, Any]) -> None:
    """A camera node that looks along its -Z axis at the target."""
    eye, target = np.array(camera["eye"]), np.array(camera["target"])
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = right, np.cross(back, right), back, eye
    perspective = {"yfov": math.radians(camera["fov"]), "znear": 0.05, "zfar": 100.0}
    number = writer.add("cameras", {"name": camera["name"], "type": "perspective", "perspective": perspective})
    node = writer.add("nodes", {"name": camera["name"], "camera": number, "matrix": matrix.T.reshape(-1).tolist()})
    writer.document["scenes"][0]["nodes"].append(node)


class _Gallery:
    """Places shapes of one geometry under many materials."""

    def __init__(self) -> None:
        self.writer = GlbWriter()
        self.writer.document["asset"]["copyright"] = "ntc-viewer authors, Apache-2.0"
        used = {"KHR_materials_emissive_strength", *(name for each in SPECIAL.values() for name in each)}
        self.writer.document["extensionsUsed"] += sorted(used)
        self._attributes: dict[int, dict[str, Any]] = {}

    def geometry(self, grid: Grid) -> int:
        """A geometry that meshes can share; its number."""
        positions, normals, tangents, uvs, indices = grid
        self._attributes[len(self._attributes)] = {
            "attributes": {
                "POSITION": self.writer.accessor(positions, bounds=True),
                "NORMAL": self.writer.accessor(normals),
                "TANGENT": self.writer.accessor(tangents),
                "TEXCOORD_0": self.writer.accessor(uvs),
            },
            "indices": self.writer.accessor(indices, indices=True),
        }
        return len(self._attributes) - 1

    def place(
        self, name: str, geometry: int, material: int, at: tuple[float, float, float], lying: bool = False
    ) -> None:
        """A node with the geometry; `lying` turns what faces +z up."""
        primitive = {**self._attributes[geometry], "material": material}
        node: dict[str, Any] = {
            "name": name,
            "mesh": self.writer.add("meshes", {"name": name, "primitives": [primitive]}),
            "translation": list(at),
        }
        if lying:
            node["rotation"] = [-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]
        self.writer.document["scenes"][0]["nodes"].append(self.writer.add("nodes", node))

    def plain(self, name: str, color: list[float], metalness: float, roughness: float, **further: Any) -> int:
        """A material of factors alone."""
        pbr = {"baseColorFactor": color, "metallicFactor": metalness, "roughnessFactor": roughness}
        return self.writer.add("materials", {"name": name, "pbrMetallicRoughness": pbr, **further})


def gallery() -> GlbWriter:
    """The whole scene."""
    made = _Gallery()
    writer = made.writer
    chosen = [recipe for recipe in recipes() if recipe.name in (*SHOWN, GROUND)]
    textures = add_textures(writer, chosen, clamped=False)
    materials = {recipe.name: writer.add("materials", material_entry(recipe.name, textures)) for recipe in chosen}
    ball, large, upright = (
        made.geometry(sphere(RADIUS)),
        made.geometry(sphere(0.5)),
        made.geometry(panel(1.1, 1.1, 1.0)),
    )
    made.place("ground", made.geometry(panel(12.0, 12.0, 6.0)), materials[GROUND], (0.0, 0.0, 0.0), lying=True)
    for row, (kind, color) in enumerate((("dielectric", CLAY), ("metal", GOLD))):
        for step in range(STEPS):
            name = f"{kind}_{step}"
            material = made.plain(name, color, float(kind == "metal"), step / (STEPS - 1))
            made.place(name, ball, material, ((step - (STEPS - 1) / 2) * PITCH, 2.6 + PITCH * row, -1.0))
    for column, (name, extensions) in enumerate(SPECIAL.items()):
        glow = {"emissiveFactor": [1.0, 0.55, 0.2]} if name == "emission" else {}
        material = made.plain(name, [0.12, 0.16, 0.45, 1.0], 0.0, 0.35, extensions=extensions, **glow)
        made.place(name, ball, material, ((column - (len(SPECIAL) - 1) / 2) * PITCH, 1.65, -1.0))
    for column, name in enumerate(SHOWN):
        x = (column - (len(SHOWN) - 1) / 2) * 1.25
        made.place(f"{name}_sphere", large, materials[name], (x, 0.5, 1.6))
        made.place(f"{name}_panel", upright, materials[name], (x, 0.56, 0.3))
    for camera in CAMERAS:
        add_camera(writer, camera)
    return writer
