"""Comparing two records."""

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from lab.benchmarks.behaviour.parts import PARTS


def numbers(file: Path) -> NDArray[Any] | None:
    """The pixels or numbers of a file; None where it has none."""
    if file.suffix == ".npy":
        return np.asarray(np.load(file))
    if file.suffix == ".png":
        config = OpenImageIO.ImageSpec()
        # Without, colours would be multiplied by alpha.
        config.attribute("oiio:UnassociatedAlpha", 1)
        return np.asarray(OpenImageIO.ImageBuf(str(file), 0, 0, config).get_pixels(OpenImageIO.UINT8))
    return None


def difference(a: Path, b: Path) -> str:
    """How two files of one name differ; "" for not at all."""
    if not a.exists() or not b.exists():
        return f"only in {'B' if b.exists() else 'A'}"
    one, other = a.read_bytes(), b.read_bytes()
    if one == other:
        return ""
    first, second = numbers(a), numbers(b)
    if first is None or second is None:
        differing = sum(x != y for x, y in zip(one, other, strict=False)) + abs(len(one) - len(other))
        return f"{differing} bytes of {len(one)} and {len(other)}"
    if first.shape != second.shape:
        return f"shapes {first.shape} and {second.shape}"
    if not first.size or (first == second).all():
        return "the same pixels, other bytes"
    apart = np.abs(first.astype(np.float64) - second.astype(np.float64))
    places = (apart > 0).any(axis=-1).sum() if a.suffix == ".png" else (apart > 0).sum()
    return f"{places} {'pixels' if a.suffix == '.png' else 'numbers'} by up to {apart.max():g}"


def compare(a: Path, b: Path) -> bool:
    """Print what differs, part by part; whether nothing does."""
    equal = True
    for part in PARTS:
        files = {file.relative_to(folder) for folder in (a, b) for file in (folder / part).rglob("*") if file.is_file()}
        if not files:
            continue
        if not (a / part).exists() or not (b / part).exists():
            print(f"{part}: recorded in one only")
            equal = False
            continue
        found = {file: text for file in sorted(files) if (text := difference(a / file, b / file))}
        print(f"{part}: {len(files) - len(found)} files equal, {len(found)} different")
        for file, text in found.items():
            print(f"  {file}: {text}")
        equal = equal and not found
    return equal
