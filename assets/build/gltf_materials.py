"""Images, textures and materials of the built-in scenes as glTF."""

import io
import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from assets.build.glb import GlbWriter
from assets.build.materials import TextureRecipe, pixels, recipes
from assets.build.surfaces import emission_image, normal_image, packed_image, surfaces

JPEG_QUALITY = 92
NORMAL_STEP = 12
"""Step of the DCT coefficients of normals: 1.3 degrees of error (root mean square), and none that a lit picture shows."""
REPEAT, CLAMP = 10497, 33071
TRILINEAR = {"magFilter": 9729, "minFilter": 9987}
ENDINGS = ("_awning", "_two_sided", "_weathered", "_clamped", "_solid")
"""How a material uses the texture that the rest of its name is."""
WEBP = "EXT_texture_webp"
GLOW = 2.0
"""KHR_materials_emissive_strength of what glows."""

Images = Mapping[str, tuple[str, bytes]]
"""By what a material reads ("base", "normal", "packed", "emission"): MIME type and file content."""


def _file(image: NDArray[np.uint8], mime: str, **options: Any) -> tuple[str, bytes]:
    """Return (MIME type, content) of an image file."""
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, mime.removeprefix("image/"), **options)
    return mime, buffer.getvalue()


def _jpeg(image: NDArray[np.uint8], **options: Any) -> tuple[str, bytes]:
    # Neither changes a pixel; together they save a tenth.
    return _file(image, "image/jpeg", optimize=True, progressive=True, **options)


def _lossless(image: NDArray[np.uint8]) -> tuple[str, bytes]:
    """Return a WebP file without loss, two thirds as large as PNG; `exact` keeps the colours of transparent pixels."""
    return _file(image, "image/webp", lossless=True, quality=90, method=4, exact=True)


def encode_image(recipe_number: int) -> tuple[str, bytes]:
    """Return (MIME type, content) of the file of a base colour: JPEG, or WebP without loss where it has holes."""
    image = pixels(recipes()[recipe_number])
    return _lossless(image) if image.shape[2] == 4 else _jpeg(image, quality=JPEG_QUALITY, subsampling="4:2:0")


def encode_images(recipe_number: int) -> Images:
    """Return the files of all images of a material."""
    surface = surfaces()[recipes()[recipe_number].name]()
    # A normal's x, y and z are no colours: stored as they are, each component with the same error at every frequency.
    normals = _jpeg(normal_image(surface.height), qtables=[[NORMAL_STEP] * 64], subsampling="4:4:4", keep_rgb=True)
    found = {"base": encode_image(recipe_number), "normal": normals, "packed": _lossless(packed_image(surface))}
    glowing = emission_image(surface)
    return found if glowing is None else {**found, "emission": _lossless(glowing)}


def add_textures(writer: GlbWriter, made: Sequence[TextureRecipe], clamped: bool = True) -> dict[str, int]:
    """Images with their category, base colours first, and textures by name: NAME, NAME/normal, NAME/packed and NAME/emission.

    If `clamped`, signs and aerial photographs do not repeat, and the wooden sign is there both ways.
    """
    writer.require(WEBP)
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
            shown = {"extensions": {WEBP: {"source": number}}} if mime == "image/webp" else {"source": number}
            textures[name] = writer.add("textures", {"name": image["name"], "sampler": sampler, **shown})
            if recipe.name == "wood_sign" and clamped:
                again = {"name": f"{image['name']}_clamped", "sampler": clamp, **shown}
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
