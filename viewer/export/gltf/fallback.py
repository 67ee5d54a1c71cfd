"""What programs that do not read packs show of an exported scene."""

import io
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ntc.codec.maps import SRGB_MAPS
from ntc.codec.mips import mip_chain
from ntc.errors import InputError
from viewer.export import Fallback
from viewer.export.gltf.document import GltfDocument, ImageFile
from viewer.export.gltf.opened import OpenedExport
from viewer.export.images.formats import FORMATS
from viewer.scene.gltf.buffers import Buffers
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.maps.images import image_bytes
from viewer.scene.gltf.textures import IMAGE_EXTENSIONS
from viewer.scene.images import decode_image, is_constant

JPEG_QUALITY = 90
"""Of libjpeg, without subsampling of colour: normals and roughness are no colours."""


def replaceable_images(document: GltfDocument, textures: set[int]) -> tuple[int, ...]:
    """Image entries that the texture entries `textures` alone read: a pack holds all of them."""
    entries = document.entries("textures")
    wanted = {index for number in textures for index in _images_of(entries[number])}
    others = {index for number, entry in enumerate(entries) if number not in textures for index in _images_of(entry)}
    return tuple(sorted(wanted - others))


def _images_of(texture: dict[str, Any]) -> set[int]:
    extensions = texture.get("extensions", {})
    owners = [texture, *(extensions[name] for name in IMAGE_EXTENSIONS if name in extensions)]
    return {owner["source"] for owner in owners if isinstance(owner.get("source"), int)}


def apply_fallback(opened: OpenedExport, textures: set[int], fallback: Fallback) -> int:
    """Replace the images of the texture entries `textures`, which a pack holds whole; returns how many were replaced.

    Raises InputError for images that cannot be read, and for KTX2 without its encoder.
    """
    if fallback == "original":
        return 0
    document, file, buffers = opened.document, opened.file, opened.buffers
    images = replaceable_images(document, textures)
    if fallback == "none":
        document.remove_images(set(images))
        return len(images)
    if fallback == "ktx2":
        return _replace_by_ktx2(opened, images)
    replaced = 0
    for index in images:
        found = _as_jpeg(file, buffers, index)
        if found is not None:
            document.replace_image(index, found)
            replaced += 1
    return replaced


def _as_jpeg(file: GltfFile, buffers: Buffers, index: int) -> ImageFile | None:
    """Image entry `index` as JPEG; None where that cannot hold it."""
    name = file.label(file.entries("images")[index], f"image {index}")
    pixels = decode_image(image_bytes(file, buffers, index), f"{file.name}: images[{index}]")
    # JPEG has no alpha, and could make one colour of an image that has hardly more.
    if pixels.shape[2] != 3:
        return None
    data = jpeg(pixels)
    if is_constant(decode_image(data, name)):
        return None
    return ImageFile(f"{name.rsplit('.', 1)[0]}.jpg", "image/jpeg", lambda: data)


def _replace_by_ktx2(opened: OpenedExport, images: tuple[int, ...]) -> int:
    """Let `images` be Basis Universal in KTX2, which textures name by its extension alone; returns how many there are."""
    document, stored = opened.document, FORMATS["ktx2"]
    colors = {
        option.image
        for options in opened.options.values()
        for option in options
        if SRGB_MAPS.intersection(name for _, name in option.references)
    }
    for index in images:
        name = opened.file.label(opened.file.entries("images")[index], f"image {index}")
        pixels = decode_image(image_bytes(opened.file, opened.buffers, index), f"{opened.file.name}: images[{index}]")
        srgb = index in colors
        data = stored.store(mip_chain(pixels, "srgb" if srgb else "linear"), srgb).data
        file = ImageFile(f"{name.rsplit('.', 1)[0]}{stored.suffix}", stored.mime_type, partial(_same, data))
        document.replace_image(index, file)
    for texture in document.entries("textures"):
        if texture.get("source") in images:
            texture.setdefault("extensions", {})[stored.extension] = {"source": texture.pop("source")}
    if images:
        document.use_extension(stored.extension, required=True)
    return len(images)


def _same(data: bytes) -> bytes:
    return data


def image_pixels(file: GltfFile, buffers: Buffers, index: int) -> NDArray[np.uint8] | None:
    """[H, W, 3 or 4] of image entry `index`; None where it cannot be read, or lies in a pack alone."""
    try:
        return decode_image(image_bytes(file, buffers, index), f"{file.name}: images[{index}]")
    except InputError:
        return None


def jpeg(pixels: NDArray[np.uint8]) -> bytes:
    """`pixels` [H, W, 3] as a JPEG file."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=JPEG_QUALITY, subsampling=0)
    return buffer.getvalue()
