"""Raw features on disk: one small file per texture and kind of features. What cannot be used is computed again."""

import hashlib
import io
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features.extractor import Extractor
from ntc.io import write_bytes

_FLOAT64 = np.dtype("<f8")


def cache_path(folder: Path, extractor: Extractor, texture: SourceTexture) -> Path:
    """Where the raw features of `texture` lie in `folder`.

    The pixel hash is that of the original image, so the shape of the pixels given and their colour space, by which
    mips are filtered, are part of the name as well. It is a digest: nothing of a texture becomes a path.
    """
    height, width, channels = texture.pixels.shape
    key = (extractor.version, texture.pixel_hash, width, height, channels, texture.color_space)
    return folder / f"{extractor.name}-{hashlib.sha256(repr(key).encode()).hexdigest()[:32]}.npy"


def _header(length: int) -> bytes:
    stream = io.BytesIO()
    described = {"descr": _FLOAT64.str, "fortran_order": False, "shape": (length,)}
    np.lib.format.write_array_header_1_0(stream, described)
    return stream.getvalue()


def read_features(path: Path, length: int) -> NDArray[np.float64] | None:
    """[length] float64 of the file at `path`, or None where there is none or it is not such a file.

    The header must be, byte for byte, the one that `write_features` writes: nothing in the file is interpreted.
    """
    header = _header(length)
    size = len(header) + length * _FLOAT64.itemsize
    try:
        if not path.is_file() or path.stat().st_size != size:
            return None
        with path.open("rb") as file:
            data = file.read(size)
    except OSError:
        return None
    if len(data) != size or not data.startswith(header):
        return None
    features = np.frombuffer(data, _FLOAT64, offset=len(header)).astype(np.float64)
    return features if bool(np.isfinite(features).all()) else None


def write_features(path: Path, features: NDArray[np.float64]) -> None:
    """Keep `features` [F] at `path`; does nothing where the folder cannot be written."""
    data = _header(len(features)) + features.astype(_FLOAT64).tobytes()
    # Without the cache everything works, only slower.
    with suppress(InputError):
        write_bytes(path, data)
