"""Many distinct small textures: crops of large ones, as PNG files."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.textures import hash_pixels
from ntc.errors import InputError
from viewer.scene.images import folder_images, is_constant, read_image, write_png

MOST_OF_ONE = 512
"""Crops of one large texture."""


def _crops(pixels: NDArray[np.uint8], side: int) -> Iterator[NDArray[np.uint8]]:
    """Squares of `side` texels, spread over the picture."""
    height, width = pixels.shape[:2]
    for y in range(0, height - side + 1, side):
        for x in range(0, width - side + 1, side):
            yield np.ascontiguousarray(pixels[y : y + side, x : x + side, :3])


def write_crops(large: Path, folder: Path, count: int, side: int) -> None:
    """Write `count` crops of [side, side] texels, no two with the same pixels, of the images in `large` into sub-folders of `folder`.

    Nothing is done where the folder is there. Raises InputError where the images do not have so many.
    """
    if folder.is_dir():
        return
    images, seen = folder_images(large), set[str]()
    each = min(MOST_OF_ONE, -(-count // len(images)))
    for image in [*images, *images]:
        if len(seen) == count:
            return
        own = 0
        for crop in _crops(read_image(image), side):
            key = hash_pixels(crop)
            if own == each or len(seen) == count:
                break
            if key in seen or is_constant(crop):
                continue
            seen.add(key)
            own += 1
            write_png(folder / image.parent.name / f"{image.stem}-{len(seen)}.png", crop)
        if image == images[-1]:
            each = MOST_OF_ONE
    if len(seen) < count:
        raise InputError(f"{large}: has {len(seen)} distinct crops of {side} texels, not {count}")


def write_tiny(folder: Path, count: int, side: int = 16) -> None:
    """Write `count` distinct pictures of [side, side] texels, a hundred to a sub-folder, unless they are there."""
    if folder.is_dir():
        return
    y, x = np.mgrid[0:side, 0:side] / side
    for number in range(count):
        chance = np.random.default_rng(number)
        waves = [np.sin(6.0 * (x * a + y * b) + c) for a, b, c in chance.random((3, 3))]
        pixels = 128.0 + 90.0 * np.stack(waves, axis=-1) + chance.normal(0.0, 4.0, (side, side, 3))
        write_png(folder / f"{number // 100:04}" / f"{number:06}.png", np.clip(pixels, 0.0, 255.0).astype(np.uint8))
