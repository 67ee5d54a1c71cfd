"""Images, textures and materials of the built-in scenes as glTF."""

import math
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from assets.build.glb import GlbWriter
from assets.build.materials import TextureRecipe, pixels, recipes
from assets.build.surfaces import emission_image, normal_image, packed_image, surfaces

JPEG_QUALITY = 92
REPEAT, CLAMP = 10497, 33071
TRILINEAR = {"magFilter": 9729, "minFilter": 9987}
ENDINGS = ("_awning", "_two_sided", "_weathered", "_clamped", "_solid")
"""How a material uses the texture that the rest of its name is."""
GLOW = 2.0
"""KHR_materials_emissive_strength of what glows."""

Images = Mapping[str, tuple[str, bytes]]
"""By what a material reads ("base", "normal", "packed", "emission"): MIME type and file content."""


def _encoded(image: NDArray[np.uint8], suffix: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"image{suffix}"
        spec = OpenImageIO.ImageSpec(image.shape[1], image.shape[0], image.shape[2], OpenImageIO.UINT8)
        spec.attribute("oiio:UnassociatedAlpha", 1)
        spec.attribute("Compression", f"jpeg:{JPEG_QUALITY}")
        spec.attribute("png:compressionLevel", 9)
        output = OpenImageIO.ImageOutput.create(str(path))
        if not (output and output.open(str(path), spec) and output.write_image(image) and output.close()):
            raise RuntimeError(f"{path}: {OpenImageIO.geterror()}")
        return path.read_bytes()


def encode_image(recipe_number: int) -> tuple[str, bytes]:
    """(MIME type, file content) of a base colour: PNG where it has holes, else JPEG."""
    image = pixels(recipes()[recipe_number])
    suffix, mime = (".png", "image/png") if image.shape[2] == 4 else (".jpg", "image/jpeg")
    return mime, _encoded(image, suffix)


def encode_images(recipe_number: int) -> Images:
    """All images of a material; those besides the base colour are PNG, as they are the truth that decoded maps are held against."""
    surface = surfaces()[recipes()[recipe_number].name]()
    found = {"normal": normal_image(surface.height), "packed": packed_image(surface)}
    glowing = emission_image(surface)
    if glowing is not None:
        found["emission"] = glowing
    further = {name: ("image/png", _encoded(image, ".png")) for name, image in found.items()}
    return {"base": encode_image(recipe_number), **further}


def add_textures(writer: GlbWriter, made: Sequence[TextureRecipe], clamped: bool = True) -> dict[str, int]:
    """Images with their category, base colours first, and textures by name: NAME, NAME/normal, NAME/packed and NAME/emission.

    If `clamped`, signs and aerial photographs do not repeat, and the wooden sign is there both ways.
    """
    repeat = writer.add("samplers", {**TRILINEAR, "wrapS": REPEAT, "wrapT": REPEAT})
    clamp = writer.add("samplers", {**TRILINEAR, "wrapS": CLAMP, "wrapT": CLAMP})
    numbers = [[recipe.name for recipe in recipes()].index(recipe.name) for recipe in made]
    with ProcessPoolExecutor() as pool:
        files = list(pool.map(encode_images, numbers))
    textures: dict[str, int] = {}
    for kind in ("base", "normal", "packed", "emission"):
        for recipe, images in zip(made, files, strict=True):
            if kind not in images:
                continue
            mime, content = images[kind]
            name = recipe.name if kind == "base" else f"{recipe.name}/{kind}"
            image = {
                "name": name.replace("/", "_"),
                "mimeType": mime,
                "bufferView": writer.view(content),
                "extras": {"category": recipe.category},
            }
            number = writer.add("images", image)
            stretched = clamped and (recipe.name == "metal_sign" or recipe.category == "aerial")
            sampler = clamp if stretched else repeat
            textures[name] = writer.add("textures", {"name": image["name"], "source": number, "sampler": sampler})
            if recipe.name == "wood_sign" and clamped:
                again = {"name": f"{image['name']}_clamped", "source": number, "sampler": clamp}
                textures[name.replace("wood_sign", "wood_sign_clamped")] = writer.add("textures", again)
    return textures


def material_entry(name: str, textures: Mapping[str, int]) -> dict[str, Any]:
    """The glTF material `name`: a texture's name, with an ending for how it is used."""
    if name == "glass":
        # Lamplight behind the panes.
        return {
            "name": name,
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.05, 0.08, 0.11, 1.0],
                "metallicFactor": 0.0,
                "roughnessFactor": 0.06,
            },
            "emissiveFactor": [0.1, 0.065, 0.028],
        }
    base, ending = name, ""
    for suffix in ENDINGS:
        if name.endswith(suffix) and name not in textures:
            base, ending = name.removesuffix(suffix), suffix
    # The clamped sign is a texture of its own name.
    source = base if name not in textures else name
    is_metal = source.startswith("metal_") or source == "roofing_corrugated"

    def reference(kind: str) -> dict[str, Any]:
        found: dict[str, Any] = {"index": textures[source + kind]}
        if base == "floor_parquet":
            turn = {"rotation": math.pi / 4, "scale": [math.sqrt(0.5) * 2, math.sqrt(0.5) * 2], "offset": [0.25, 0.0]}
            found["extensions"] = {"KHR_texture_transform": turn}
        return found

    entry: dict[str, Any] = {
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorTexture": reference(""),
            "metallicRoughnessTexture": reference("/packed"),
            "metallicFactor": 1.0 if is_metal else 0.0,
            "roughnessFactor": 1.0,
        },
        "normalTexture": reference("/normal"),
        "occlusionTexture": reference("/packed"),
    }
    if f"{source}/emission" in textures:
        entry["emissiveTexture"] = reference("/emission")
        entry["emissiveFactor"] = [1.0, 1.0, 1.0]
        entry["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": GLOW}}
    if base == "metal_lattice" and ending != "_solid":
        entry |= {"alphaMode": "MASK", "alphaCutoff": 0.5, "doubleSided": True}
    if ending in ("_awning", "_two_sided"):
        entry["doubleSided"] = True
    return entry
