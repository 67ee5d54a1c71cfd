"""Contact sheets: small pictures with a title each, side by side."""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from ntc.io import write_bytes

TITLE_HEIGHT, GAP = 14, 4
BACKGROUND, INK = (24, 24, 24), (230, 230, 230)
QUALITY = 82


def write_sheet(path: Path, pictures: Sequence[tuple[str, NDArray[np.uint8]]], width: int, columns: int) -> None:
    """Write `pictures`, (title, [H, W, 3] uint8), as one WebP, each scaled to `width` pixels, in rows of `columns`."""
    small = []
    for title, pixels in pictures:
        image = Image.fromarray(pixels)
        small.append(
            (title, image.resize((width, round(image.height * width / image.width)), Image.Resampling.LANCZOS))
        )
    height = max(image.height for _, image in small) + TITLE_HEIGHT
    rows = -(-len(small) // columns)
    sheet = Image.new("RGB", (columns * (width + GAP) + GAP, rows * (height + GAP) + GAP), BACKGROUND)
    draw = ImageDraw.Draw(sheet)
    for number, (title, image) in enumerate(small):
        left, top = GAP + number % columns * (width + GAP), GAP + number // columns * (height + GAP)
        room = title
        while draw.textlength(room) > width:
            room = room[:-1]
        draw.text((left, top), room, fill=INK)
        sheet.paste(image, (left, top + TITLE_HEIGHT))
    buffer = io.BytesIO()
    sheet.save(buffer, "WEBP", quality=QUALITY, method=6)
    write_bytes(path, buffer.getvalue())
