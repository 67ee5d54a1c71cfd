"""`python -m assets.build`: makes assets/courtyard.glb and assets/courtyard.cameras.json. Deterministic."""

import json
import math
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from assets.build.courtyard import cameras, models
from assets.build.glb import GlbWriter
from assets.build.materials import TextureRecipe, pixels, recipes
from assets.build.shapes import Model, Placement
from ntc.io import write_bytes, write_text

ASSETS = Path(__file__).resolve().parents[1]
JPEG_QUALITY = 92
REPEAT, CLAMP = 10497, 33071
TRILINEAR = {"magFilter": 9729, "minFilter": 9987}


def encode_image(recipe_number: int) -> tuple[str, bytes]:
    """(MIME type, file content) of a texture: PNG where it has holes, else JPEG."""
    recipe = recipes()[recipe_number]
    image = pixels(recipe)
    suffix, mime = (".png", "image/png") if image.shape[2] == 4 else (".jpg", "image/jpeg")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"image{suffix}"
        spec = OpenImageIO.ImageSpec(image.shape[1], image.shape[0], image.shape[2], OpenImageIO.UINT8)
        spec.attribute("oiio:UnassociatedAlpha", 1)
        spec.attribute("Compression", f"jpeg:{JPEG_QUALITY}")
        spec.attribute("png:compressionLevel", 9)
        output = OpenImageIO.ImageOutput.create(str(path))
        if not (output and output.open(str(path), spec) and output.write_image(image) and output.close()):
            raise RuntimeError(f"{recipe.name}: {OpenImageIO.geterror()}")
        return mime, path.read_bytes()


def material_entry(name: str, textures: dict[str, int]) -> dict[str, Any]:
    """The glTF material `name`: a texture's name, with an ending for how it is used."""
    if name == "glass":
        return {
            "name": name,
            "pbrMetallicRoughness": {"baseColorFactor": [0.05, 0.08, 0.11, 1.0], "metallicFactor": 0.0},
        }
    base, ending = name, ""
    for suffix in ("_awning", "_two_sided", "_weathered", "_clamped", "_solid"):
        if name.endswith(suffix) and name not in textures:
            base, ending = name.removesuffix(suffix), suffix
    reference: dict[str, Any] = {"index": textures[f"{base}_clamped" if ending == "_clamped" else base]}
    if base == "floor_parquet":
        turn = {"rotation": math.pi / 4, "scale": [math.sqrt(0.5) * 2, math.sqrt(0.5) * 2], "offset": [0.25, 0.0]}
        reference["extensions"] = {"KHR_texture_transform": turn}
    entry: dict[str, Any] = {
        "name": name,
        "pbrMetallicRoughness": {"baseColorTexture": reference, "metallicFactor": 0.0, "roughnessFactor": 1.0},
    }
    if base == "metal_lattice" and ending != "_solid":
        entry |= {"alphaMode": "MASK", "alphaCutoff": 0.5, "doubleSided": True}
    if ending in ("_awning", "_two_sided"):
        entry["doubleSided"] = True
    return entry


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
        positions, uvs, indices = shape.arrays()
        attributes = {"POSITION": writer.accessor(positions, bounds=True), "TEXCOORD_0": writer.accessor(uvs)}
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


def add_textures(writer: GlbWriter, made: tuple[TextureRecipe, ...]) -> dict[str, int]:
    """Images with their category, and textures by name; the wooden sign also clamped."""
    repeat = writer.add("samplers", {**TRILINEAR, "wrapS": REPEAT, "wrapT": REPEAT})
    clamp = writer.add("samplers", {**TRILINEAR, "wrapS": CLAMP, "wrapT": CLAMP})
    textures: dict[str, int] = {}
    with ProcessPoolExecutor() as pool:
        for recipe, (mime, content) in zip(made, pool.map(encode_image, range(len(made))), strict=True):
            image = {
                "name": recipe.name,
                "mimeType": mime,
                "bufferView": writer.view(content),
                "extras": {"category": recipe.category},
            }
            number = writer.add("images", image)
            sampler = clamp if recipe.name == "metal_sign" or recipe.category == "aerial" else repeat
            textures[recipe.name] = writer.add("textures", {"name": recipe.name, "source": number, "sampler": sampler})
            if recipe.name == "wood_sign":
                clamped = {"name": "wood_sign_clamped", "source": number, "sampler": clamp}
                textures["wood_sign_clamped"] = writer.add("textures", clamped)
    return textures


def main() -> None:
    """Write the scene and its cameras."""
    made = recipes()
    writer = GlbWriter()
    writer.document["asset"]["copyright"] = "ntc-viewer authors, Apache-2.0"
    writer.document["extensionsUsed"] = ["KHR_texture_transform"]
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


if __name__ == "__main__":
    main()
