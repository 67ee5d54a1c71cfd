"""libntc, compiled for tests, and called from Python by ctypes."""

import ctypes
import functools
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.c.library import Options
from ntc.codec.maps import CODED_MAPS

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "ntc" / "c"
WARNINGS = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")
BC4, BC5, BC7, BC4_QUICK, BC5_QUICK, BC7_QUICK = range(6)


def compiler() -> str:
    """The C compiler of this machine; tests skip without one."""
    found = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if found is None:
        pytest.skip("there is no C compiler: apt-get install gcc")
    return found


def compiled(out: Path, *options: str, sources: tuple[Path, ...] = ()) -> Path:
    """Compile libntc with `sources` into `out`; any warning is an error."""
    own = (*sources, SOURCE / "ntc.c")
    command: list[str | Path] = [compiler(), *WARNINGS, *options, "-I", SOURCE, *own, "-lm", "-o", out]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return out


class TextureInfo(ctypes.Structure):
    """`ntc_texture_info`."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("pixel_hash", ctypes.c_char_p),
        ("width", ctypes.c_int),
        ("height", ctypes.c_int),
        ("mips", ctypes.c_int),
        ("channels", ctypes.c_int),
        ("map_count", ctypes.c_int),
        ("maps", ctypes.c_int * len(CODED_MAPS)),
        ("map_channels", ctypes.c_int * len(CODED_MAPS)),
        ("is_srgb", ctypes.c_int),
        ("wrap", ctypes.c_int * 2),
    )


@functools.cache
def library() -> ctypes.CDLL:
    """libntc as a shared library."""
    return ctypes.CDLL(str(compiled(Path(tempfile.mkdtemp()) / "libntc.so", "-O2", "-shared", "-fPIC")))


class NativePack:
    """A pack that libntc has opened."""

    def __init__(self, handle: ctypes.c_void_p) -> None:
        self.handle = handle

    def info(self, texture: int) -> TextureInfo:
        """Return the facts about a texture."""
        found = TextureInfo()
        assert library().ntc_texture(self.handle, texture, ctypes.byref(found)) == 0
        return found

    def status(self, texture: int, mip: int) -> int:
        """Return the status of decoding one texel."""
        texel = ctypes.create_string_buffer(64)
        status: int = library().ntc_decode(self.handle, texture, mip, 0, 0, 1, 1, 0, texel, ctypes.c_size_t(64))
        return status

    def decode(
        self, texture: int, mip: int, x: int, y: int, width: int, height: int, kind: Any = np.uint8
    ) -> NDArray[Any] | int:
        """Return [height, width, channels] of a rectangle, or the status that is not 0."""
        texels = np.zeros((max(height, 0), max(width, 0), self.info(texture).channels), kind)
        place = texels.ctypes.data_as(ctypes.c_void_p)
        form, row = 0 if kind == np.uint8 else 1, ctypes.c_size_t(texels.strides[0])
        status: int = library().ntc_decode(self.handle, texture, mip, x, y, width, height, form, place, row)
        return texels if status == 0 else status

    def blocks(self, texture: int, mip: int, map_number: int, form: int) -> bytes:
        """Return the blocks of a map of a mip, row by row."""
        own = self.info(texture)
        across, down = (-(-max(1, side >> mip) // 4) for side in (own.width, own.height))
        row = across * (8 if form in (BC4, BC4_QUICK) else 16)
        out = ctypes.create_string_buffer(row * down)
        status = library().ntc_decode_blocks(self.handle, texture, mip, map_number, form, out, ctypes.c_size_t(row))
        assert status == 0
        return out.raw


def compressed(texels: bytes, form: int) -> bytes:
    """Return the block of 4x4 texels of RGBA."""
    block = ctypes.create_string_buffer(16)
    written = library().ntc_compress(texels, form, block)
    return block.raw[:written]


def opened(data: bytes, tables: bytes = b"") -> tuple[int, str, ctypes.c_void_p]:
    """Return (status, text of the error, handle) of opening `data`."""
    handle, error, options = ctypes.c_void_p(), ctypes.create_string_buffer(200), Options()
    if tables:
        options.tables, options.tables_bytes = tables, len(tables)
    status = library().ntc_open(
        data,
        ctypes.c_size_t(len(data)),
        ctypes.byref(options),
        ctypes.byref(handle),
        ctypes.cast(error, ctypes.c_void_p),
    )
    return status, error.value.decode(), handle


@contextmanager
def native_pack(data: bytes, tables: bytes = b"") -> Iterator[NativePack]:
    """Open `data` by libntc, and close it."""
    status, error, handle = opened(data, tables)
    assert status == 0, error
    yield NativePack(handle)
    library().ntc_close(handle)
