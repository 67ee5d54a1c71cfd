"""What programs that do not read packs show of an exported scene."""

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ntc.errors import InputError
from viewer.export import Fallback
from viewer.export.gltf.document import GltfDocument, ImageFile
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


def apply_fallback(
    document: GltfDocument, file: GltfFile, buffers: Buffers, textures: set[int], fallback: Fallback
) -> int:
    """Replace the images of the texture entries `textures`, which a pack holds whole; returns how many were replaced.

    Raises InputError for images that cannot be read.
    """
    if fallback == "original":
        return 0
    images = replaceable_images(document, textures)
    if fallback == "none":
        document.remove_images(set(images))
        return len(images)
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
