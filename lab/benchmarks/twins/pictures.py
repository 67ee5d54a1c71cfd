"""Twins with other images: KTX2 of every kind that is read, WebP, and an archive of plain files."""

import io
import json
import zipfile
import zlib
from collections.abc import Callable
from typing import Any, Literal

import alktx2
import numpy as np
import zstandard
from numpy.typing import NDArray
from PIL import Image

from lab.benchmarks.twins.geometry import Error, Twin
from lab.benchmarks.twins.plain_scene import PlainScene
from ntc.errors import InputError
from ntc.metrics.block_compression import decode_bc, encode_bc7
from tests.support.gltf_builder import ktx2
from tests.support.meshopt_twins import glb_parts

RGBA_SRGB, BC7_SRGB = 43, 146
WEBP_QUALITY, BASIS_QUALITY = 90, 90
Encoded = tuple[bytes, NDArray[np.uint8]]
"""A file, and the pixels [H, W, 3 or 4] that another decoder than the one under test gives of it."""
Encode = Callable[[NDArray[np.uint8]], Encoded]


def _with_images(scene: PlainScene, encode: Encode, mime: str, extension: str | None) -> Twin:
    twin, other = scene.copy(), scene.copy()
    worst = 0
    if extension is not None:
        twin.use(extension)
    shown = _base_images(scene)
    textures = twin.content.get("textures", [])
    for texture in textures:
        texture.pop("extensions", None)
    plain = {texture["source"] for texture in textures}
    for number, image in enumerate(twin.content.get("images", [])):
        if number not in plain:
            continue
        pixels = _pixels(twin.views[image["bufferView"]])
        data, decoded = encode(pixels)
        worst = max(worst, _difference(pixels, decoded) if number in shown else 0)
        image |= {"bufferView": twin.add_view(data), "mimeType": mime}
        _show(other, number, decoded[..., : pixels.shape[2]])
    for texture in textures if extension is not None else ():
        texture["extensions"] = {extension: {"source": texture.pop("source")}}
    for texture in other.content.get("textures", []):
        texture.pop("extensions", None)
    return Twin(twin.glb(), Error(texel=worst), decoded=other.glb())


def _base_images(scene: PlainScene) -> set[int]:
    """The images that materials show as base colours: a picture of base colours shows no others."""
    infos = [m.get("pbrMetallicRoughness", {}).get("baseColorTexture") for m in scene.content.get("materials", [])]
    return {scene.content["textures"][info["index"]]["source"] for info in infos if info is not None}


def _pixels(data: bytes) -> NDArray[np.uint8]:
    with Image.open(io.BytesIO(data)) as opened:
        return np.asarray(opened.convert("RGBA" if "A" in opened.getbands() else "RGB"))


def _difference(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> int:
    return int(np.abs(one[..., :3].astype(int) - other[..., :3]).max())


def _show(scene: PlainScene, image: int, pixels: NDArray[np.uint8]) -> None:
    """Let `image` be a PNG of `pixels`."""
    scene.content["images"][image] |= {"bufferView": scene.add_view(_png(pixels)), "mimeType": "image/png"}


def own_ktx2(scene: PlainScene) -> Twin:
    """Only the KTX2 copies that the scene itself has of its images. Raises InputError where it has none."""
    twin, other = scene.copy(), scene.copy()
    worst = 0
    shown = _base_images(scene)
    pairs = [
        texture for texture in twin.content.get("textures", []) if "KHR_texture_basisu" in texture.get("extensions", {})
    ]
    if not pairs:
        raise InputError("the scene has no KTX2 of its own")
    twin.use("KHR_texture_basisu")
    for texture in pairs:
        copy, plain = texture["extensions"]["KHR_texture_basisu"]["source"], texture.pop("source")
        images = scene.content["images"]
        decoded = _basis_pixels(scene.views[images[copy]["bufferView"]])
        pixels = _pixels(scene.views[images[plain]["bufferView"]])
        worst = max(worst, _difference(pixels, decoded) if plain in shown else 0)
        _show(other, plain, decoded[..., : pixels.shape[2]])
    for texture in other.content["textures"]:
        texture.pop("extensions", None)
    return Twin(twin.glb(), Error(texel=worst), decoded=other.glb())


def _basis_pixels(data: bytes) -> NDArray[np.uint8]:
    with Image.open(io.BytesIO(alktx2.decode_ktx2_to_bytes(data)[0])) as decoded:
        return np.asarray(decoded.convert("RGBA"))


def _png(pixels: NDArray[np.uint8]) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()


def basis(codec: Literal["etc1s", "uastc"]) -> Callable[[PlainScene], Twin]:
    """KHR_texture_basisu by `codec`."""

    def encode(pixels: NDArray[np.uint8]) -> Encoded:
        data = alktx2.encode_bytes_to_ktx2(_png(pixels), mime="image/png", codec=codec, quality=BASIS_QUALITY)
        return data, _basis_pixels(data)

    return lambda scene: _with_images(scene, encode, "image/ktx2", "KHR_texture_basisu")


def plain_ktx2(scheme: int) -> Callable[[PlainScene], Twin]:
    """RGBA bytes in KTX2 as the source of textures: plain (0), Zstandard (2), zlib (3)."""
    pack: dict[int, Callable[[bytes], bytes]] = {
        0: lambda data: data,
        2: lambda data: bytes(zstandard.ZstdCompressor().compress(data)),
        3: zlib.compress,
    }

    def encode(pixels: NDArray[np.uint8]) -> Encoded:
        wide = _rgba(pixels)
        return ktx2(pack[scheme](wide.tobytes()), wide.shape[1::-1], RGBA_SRGB, scheme=scheme), wide

    return lambda scene: _with_images(scene, encode, "image/ktx2", None)


def bc7(scene: PlainScene) -> Twin:
    """Blocks of BC7 in KTX2 behind Zstandard, as the source of textures."""

    def encode(pixels: NDArray[np.uint8]) -> Encoded:
        height, width = pixels.shape[:2]
        wide = np.ascontiguousarray(np.pad(_rgba(pixels), ((0, -height % 4), (0, -width % 4), (0, 0)), mode="edge"))
        blocks = encode_bc7(wide, "medium")
        shown = decode_bc(blocks, wide.shape[1], wide.shape[0], 7)[:height, :width]
        data = zstandard.ZstdCompressor().compress(blocks)
        return ktx2(data, (width, height), BC7_SRGB, scheme=2), shown

    return _with_images(scene, encode, "image/ktx2", None)


def webp(lossless: bool) -> Callable[[PlainScene], Twin]:
    """EXT_texture_webp."""

    def encode(pixels: NDArray[np.uint8]) -> Encoded:
        buffer = io.BytesIO()
        Image.fromarray(pixels).save(buffer, "WEBP", lossless=lossless, quality=WEBP_QUALITY, exact=True)
        with Image.open(io.BytesIO(buffer.getvalue())) as decoded:
            return buffer.getvalue(), np.asarray(decoded)

    return lambda scene: _with_images(scene, encode, "image/webp", "EXT_texture_webp")


def _rgba(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    if pixels.shape[2] == 4:
        return np.ascontiguousarray(pixels)
    return np.dstack([pixels, np.full(pixels.shape[:2], 255, np.uint8)])


def archive(scene: PlainScene) -> Twin:
    """A zip archive of a .gltf, its buffer and its images, in a folder."""
    content, binary = glb_parts(scene.glb())
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as files:
        for number, image in enumerate(content.get("images", [])):
            view: dict[str, Any] = content["bufferViews"][image.pop("bufferView")]
            name = f"textures/image {number}.{image['mimeType'].partition('/')[2]}"
            image["uri"] = name.replace(" ", "%20")
            start = view["byteOffset"]
            files.writestr(f"source/{name}", binary[start : start + view["byteLength"]])
        content["buffers"][0]["uri"] = "scene.bin"
        files.writestr("source/scene.bin", binary)
        files.writestr("source/scene.gltf", json.dumps(content))
    return Twin(buffer.getvalue(), suffix=".zip")
