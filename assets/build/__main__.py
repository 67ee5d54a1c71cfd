"""`python -m assets.build`: makes assets/courtyard.glb, assets/courtyard.cameras.json and assets/gallery.glb. Deterministic."""

import json
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from assets.build.courtyard import cameras, models
from assets.build.gallery import add_camera, gallery
from assets.build.glb import GlbWriter
from assets.build.gltf_materials import add_textures, material_entry
from assets.build.materials import recipes
from assets.build.shapes import Model, Placement
from ntc.io import write_bytes, write_text

ASSETS = Path(__file__).resolve().parents[1]


def quaternion(placement: Placement) -> list[float]:
    """Rotation about the Y axis."""
    return [0.0, math.sin(placement.rotation_y / 2), 0.0, math.cos(placement.rotation_y / 2)]


def weathering(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """[V, 4] linear vertex colours: damp and dark near the ground."""
    share = np.clip(positions[:, 1] / 0.8, 0.0, 1.0)[:, None]
    damp, dry = np.array([0.35, 0.42, 0.30, 1.0]), np.array([1.0, 0.98, 0.94, 1.0])
    return damp * (1.0 - share) + dry * share


def add_model(writer: GlbWriter, model: Model, materials: dict[str, int], textures: dict[str, int]) -> None:
    """One mesh, and a node for each placement of it."""
    primitives = []
    for name, shape in model.shapes.items():
        if name not in materials:
            materials[name] = writer.add("materials", material_entry(name, textures))
        positions, normals, uvs, indices = shape.arrays()
        attributes = {
            "POSITION": writer.accessor(positions, bounds=True),
            "NORMAL": writer.accessor(normals),
            "TEXCOORD_0": writer.accessor(uvs),
        }
        if name.endswith("_weathered") and name not in textures:
            attributes["COLOR_0"] = writer.accessor(weathering(positions))
        primitives.append(
            {"attributes": attributes, "indices": writer.accessor(indices, indices=True), "material": materials[name]}
        )
    mesh = writer.add("meshes", {"name": model.name, "primitives": primitives})
    for placement in model.placements:
        node = {"name": placement.name, "mesh": mesh, "translation": list(placement.translation)}
        if placement.rotation_y:
            node["rotation"] = quaternion(placement)
        if placement.scale != (1.0, 1.0, 1.0):
            node["scale"] = list(placement.scale)
        writer.document["scenes"][0]["nodes"].append(writer.add("nodes", node))


def main() -> None:
    """Write the scene and its cameras."""
    made = recipes()
    writer = GlbWriter()
    writer.document["asset"]["copyright"] = "ntc-viewer authors, Apache-2.0"
    writer.document["extensionsUsed"] += ["KHR_texture_transform", "KHR_materials_emissive_strength"]
    textures = add_textures(writer, made)
    materials: dict[str, int] = {}
    for model in models([recipe.name for recipe in made]):
        add_model(writer, model, materials, textures)
    for camera in cameras():
        add_camera(writer, camera)
    content = writer.bytes()
    write_bytes(ASSETS / "courtyard.glb", content)
    write_text(ASSETS / "courtyard.cameras.json", json.dumps(cameras(), indent=2) + "\n")
    print(f"courtyard.glb: {len(content) / 1e6:.1f} MB, {len(made)} textures, {len(materials)} materials")
    content = gallery().bytes()
    write_bytes(ASSETS / "gallery.glb", content)
    print(f"gallery.glb: {len(content) / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
