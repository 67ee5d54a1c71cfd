"""Decoding by libntc, if it was built with the package: many times faster than the float64 reference, and within one 8-bit step."""

import ctypes
import weakref
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from ntc.c.library import Options, library
from ntc.codec.latents import texture_levels
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from ntc.pack.file import pack_bytes

_opened: "weakref.WeakKeyDictionary[Pack, _Opened | None]" = weakref.WeakKeyDictionary()
_opening = Lock()


def _close(libntc: ctypes.CDLL, handle: ctypes.c_void_p, data: tuple[bytes, bytes]) -> None:
    del data
    libntc.ntc_close(handle)


class _Opened:
    """A pack that libntc has open, and the bytes that it reads."""

    def __init__(self, libntc: ctypes.CDLL, handle: ctypes.c_void_p, data: bytes, tables: bytes) -> None:
        self.handle = handle
        weakref.finalize(self, _close, libntc, handle, (data, tables))


def native_image(pack: Pack, texture_index: int, level: int = 0) -> NDArray[np.uint8] | None:
    """Decode mip `level` of a texture by libntc: [h, w, channels] uint8, each value within 1 of `ntc.codec.reference.decode_image`.

    Returns None if libntc was not built, or does not decode the pack. Several threads may call it.
    """
    libntc = library()
    if libntc is None:
        return None
    with _opening:
        if pack not in _opened:
            _opened[pack] = _open(libntc, pack)
        opened = _opened[pack]
    if opened is None:
        return None
    texture = pack.textures[texture_index]
    size = texture_levels(texture, pack.config)[level]
    texels = np.empty((size.texel_height, size.texel_width, texture.channels), np.uint8)
    place, row = texels.ctypes.data_as(ctypes.c_void_p), ctypes.c_size_t(texels.strides[0])
    extent = (size.texel_width, size.texel_height)
    status: int = libntc.ntc_decode(opened.handle, texture_index, level, 0, 0, *extent, 0, place, row)
    return texels if status == 0 else None


def _open(libntc: ctypes.CDLL, pack: Pack) -> _Opened | None:
    tables = codec_of(pack.config).libntc_tables(pack)
    if tables is None:
        return None
    data, handle = pack_bytes(pack), ctypes.c_void_p()
    options = Options(tables=tables or None, tables_bytes=len(tables))
    status = libntc.ntc_open(data, ctypes.c_size_t(len(data)), ctypes.byref(options), ctypes.byref(handle), None)
    return _Opened(libntc, handle, data, tables) if status == 0 else None
