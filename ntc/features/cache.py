"""Raw features on disk: one small file per texture and kind of features. What cannot be used is computed again."""

import hashlib
import io
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.features.extractor import Extractor
from ntc.files import write_bytes
from ntc.textures import SourceTexture

_LARGEST_HEADER = 4096
"""Bytes before the numbers of a .npy file; numpy writes 128."""
_FLOAT64 = np.dtype("<f8")


def cache_path(folder: Path, extractor: Extractor, texture: SourceTexture) -> Path:
    """Where the raw features of `texture` lie in `folder`.

    The pixel hash is that of the original image, so the shape of the pixels given and their colour space, by which
    mips are filtered, are part of the name as well. It is a digest: nothing of a texture becomes a path.
    """
    height, width, channels = texture.pixels.shape
    key = (extractor.version, texture.pixel_hash, width, height, channels, texture.color_space)
    return folder / f"{extractor.name}-{hashlib.sha256(repr(key).encode()).hexdigest()[:32]}.npy"


def _parse(data: bytes, length: int) -> NDArray[np.float64] | None:
    stream = io.BytesIO(data)
    if np.lib.format.read_magic(stream) != (1, 0):
        return None
    shape, _, dtype = np.lib.format.read_array_header_1_0(stream, max_header_size=_LARGEST_HEADER)
    numbers = data[stream.tell() :]
    if shape != (length,) or dtype != _FLOAT64 or len(numbers) != length * _FLOAT64.itemsize:
        return None
    features = np.frombuffer(numbers, _FLOAT64).astype(np.float64)
    return features if bool(np.isfinite(features).all()) else None


def read_features(path: Path, length: int) -> NDArray[np.float64] | None:
    """[length] float64 of the file at `path`, or None where there is none or it is not such a file."""
    largest = _LARGEST_HEADER + length * _FLOAT64.itemsize
    try:
        if not path.is_file() or path.stat().st_size > largest:
            return None
        with path.open("rb") as file:
            data = file.read(largest + 1)
        return _parse(data, length)
    # A broken header shows as any of these; the features are then computed again.
    except (OSError, ValueError, TypeError, SyntaxError, EOFError):
        return None


def write_features(path: Path, features: NDArray[np.float64]) -> None:
    """Keep `features` [F] at `path`; does nothing where the folder cannot be written."""
    stream = io.BytesIO()
    np.lib.format.write_array(stream, features.astype(_FLOAT64), version=(1, 0), allow_pickle=False)
    # Without the cache everything works, only slower.
    with suppress(InputError):
        write_bytes(path, stream.getvalue())
