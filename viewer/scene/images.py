"""Image files to 8-bit pixels and back, through OpenImageIO."""

import math
import os
import tempfile
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from ntc.codec.mips import linear_to_srgb
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from ntc.io import atomic_path, is_partial, read_file
from viewer.scene.ktx2 import is_ktx, read_ktx2

LARGEST_EXCESS = 1e-3
"""Distance that floating-point values may lie above 1, by rounding."""
_SUFFIXES = ".png .jpg .jpeg .webp .tif .tiff .bmp .tga .dds .ktx2 .exr .hdr .gif .jp2 .jxl .pnm .ppm .pgm .psd"
IMAGE_SUFFIXES = frozenset(_SUFFIXES.split())
"""Suffixes of the files that `folder_textures` reads."""

MAX_SIDE = 1 << 15
MOST_CHANNELS = 256
LARGEST_MEGABYTES = 4096
"""Largest size of an image's stored pixels. Below it, the length of the file limits the size."""
FREE_VALUES = 1 << 24
"""Channel values (width x height x channels) that are always allowed, however small the file is."""
MAX_EXPANSION = 1100
"""Decoded values for each byte of a file beyond FREE_VALUES: a little above the best ratio of deflate."""
LARGE_VALUES = 1 << 28
LARGE_EXPANSION = 128
"""Decoded values for each byte beyond LARGE_VALUES (8192 x 8192 texels of 4 channels): more counts as a decompression bomb."""
SINGLE_PRECISION = 4
"""Bytes of a value while a floating-point image is read."""

_SIGNATURES = (
    (b"\x89PNG", ".png"),
    (b"\xff\xd8\xff", ".jpg"),
    (b"RIFF", ".webp"),
    (b"DDS ", ".dds"),
    (b"v/1\x01", ".exr"),
    (b"GIF8", ".gif"),
    (b"BM", ".bmp"),
    (b"II*\0", ".tif"),
    (b"MM\0*", ".tif"),
    (b"#?RADIANCE", ".hdr"),
    (b"8BPS", ".psd"),
)

# Some readers of OpenImageIO allocate the whole picture when they open a file, before its size can be checked.
OpenImageIO.attribute("limits:imagesize_MB", LARGEST_MEGABYTES)
OpenImageIO.attribute("limits:resolution", MAX_SIDE)
OpenImageIO.attribute("limits:channels", MOST_CHANNELS)

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


class ProgressReport(Protocol):
    """Receiver of progress, such as `viewer.jobs.job.JobReport`."""

    def progress(self, done: int, of: int) -> None:
        """Take the progress: `done` of `of` steps. An exception raised here ends the work."""
        ...


def map_in_threads(
    function: Callable[[_Item], _Result], items: Iterable[_Item], report: ProgressReport | None = None
) -> list[_Result]:
    """Return the results of `function` in the order of `items`, from all cores (OpenImageIO and hashlib release the GIL).

    After an exception of `function` or `report`, no further item is begun.
    """
    pool = ThreadPoolExecutor(max(1, os.cpu_count() or 1))
    try:
        futures = [pool.submit(function, item) for item in items]
        if report is not None:
            for done, future in enumerate(as_completed(futures), 1):
                future.result()
                report.progress(done, len(futures))
        return [future.result() for future in futures]
    finally:
        pool.shutdown(cancel_futures=True)


def image_suffix(data: bytes, name: str) -> str:
    """Return the suffix of the image file `data` by its signature, else that of `name`."""
    for signature, suffix in _SIGNATURES:
        if data.startswith(signature):
            return suffix
    suffix = Path(name).suffix.lower()
    return suffix if suffix in IMAGE_SUFFIXES else ".img"


def values_allowed(byte_count: int) -> int:
    """Return the most channel values (bytes, once decoded) of an image file of `byte_count` bytes."""
    return min(FREE_VALUES + MAX_EXPANSION * byte_count, max(LARGE_VALUES, LARGE_EXPANSION * byte_count))


def library_message(take: Callable[[], str]) -> str:
    """Return the first line of OpenImageIO's last error. It may quote bytes of a broken file that are no text."""
    try:
        return (take() or "truncated").splitlines()[0]
    except UnicodeDecodeError:
        return "broken"


def _read(path: str, byte_count: int, name: str) -> NDArray[np.uint8]:
    # Otherwise OpenImageIO multiplies colours by alpha, and textures darken where they are transparent.
    config = OpenImageIO.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    image = OpenImageIO.ImageInput.open(path, config)
    if image is None:
        # Drop OpenImageIO's message: it names the temporary file.
        library_message(OpenImageIO.geterror)
        raise InputError(f"{name}: not an image that OpenImageIO {OpenImageIO.__version__} reads; give a PNG or JPEG")
    try:
        spec = image.spec()
        width, height, channels = spec.width, spec.height, spec.nchannels
        if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE and spec.depth <= 1 and channels >= 1):
            raise InputError(f"{name}: image of {width} x {height} x {channels}; sides are 1 to {MAX_SIDE} texels")
        linear = str(spec.format) in ("float", "half", "double")
        if width * height * channels * (SINGLE_PRECISION if linear else 1) > values_allowed(byte_count):
            raise InputError(f"{name}: {width} x {height} texels in {byte_count} bytes; the image is broken")
        pixels: Any = image.read_image(0, 0, 0, min(channels, 4), "float" if linear else "uint8")
        if pixels is None or image.has_error:
            raise InputError(f"{name}: the image does not decode ({library_message(image.geterror)}); replace it")
    finally:
        image.close()
    pixels = np.asarray(pixels).reshape(height, width, -1)
    if linear:
        colors = pixels.shape[2] - (pixels.shape[2] % 2 == 0)
        largest = float(np.nan_to_num(pixels, nan=0.0, posinf=np.inf).max())
        if largest > 1.0 + LARGEST_EXCESS:
            raise InputError(
                f"{name}: holds values up to {largest:.4g}; textures are colours from 0 to 1: scale or tone-map it first"
            )
        pixels = _encoded(pixels, colors)
    return _as_colors(pixels, tuple(spec.channelnames[:2]) == ("R", "G"))


def _as_colors(pixels: NDArray[np.uint8], red_green: bool) -> NDArray[np.uint8]:
    """Return `pixels` [H, W, 1 to 4] as RGB or RGBA [H, W, 3 or 4]. Two channels are red and green, as in BC5, or grey and alpha."""
    if pixels.shape[2] == 2 and red_green:
        pixels = np.pad(pixels, ((0, 0), (0, 0), (0, 1)))
    elif pixels.shape[2] <= 2:
        pixels = np.concatenate([np.repeat(pixels[..., :1], 3, axis=2), pixels[..., 1:]], axis=2)
    return np.ascontiguousarray(pixels)


def _encoded(pixels: NDArray[np.float32], colors: int) -> NDArray[np.uint8]:
    """Return linear floating-point `pixels` [H, W, C] as bytes: the first `colors` channels in sRGB, the others linear."""
    encoded = np.empty(pixels.shape, np.uint8)
    # Row by row: the steps between take a multiple of the picture's memory.
    for source, target in zip(pixels, encoded, strict=True):
        in_range = np.clip(np.nan_to_num(source, nan=0.0), 0.0, 1.0)
        row = np.concatenate([linear_to_srgb(in_range[:, :colors]), in_range[:, colors:]], axis=1)
        target[:] = (row * 255 + 0.5).astype(np.uint8)
    return encoded


def decode_image(data: bytes, name: str) -> NDArray[np.uint8]:
    """Return the pixels [H, W, C] uint8 of the image file in `data`, C = 3 (RGB) or 4 (RGBA, colours not multiplied by alpha).

    Row 0 is the file's top row. Grey becomes RGB, 16 bits become 8, floating point becomes sRGB; EXIF orientation
    and colour profiles are ignored, as glTF asks. `name` is for messages. Raises InputError.
    """
    if not data:
        raise InputError(f"{name}: the image is empty (0 bytes); replace it")
    if is_ktx(data):
        content = read_ktx2(data, name, MAX_SIDE, values_allowed(len(data)))
        if not isinstance(content, bytes):
            return _as_colors(content, red_green=True)
        data = content
    # The wheel cannot read from memory; names from the scene could have a special meaning to OpenImageIO.
    path: str | None = None
    try:
        try:
            handle, path = tempfile.mkstemp(suffix=image_suffix(data, name), prefix="ntc-viewer-")
            with os.fdopen(handle, "wb") as file:
                file.write(data)
        except OSError as error:
            # Without a writable folder Python's message lists every folder it tried: too long for one line.
            reason = error.strerror if path is not None else "no writable folder"
            raise InputError(f"{name}: no temporary file could be written ({reason}); set TMPDIR") from error
        return _read(path, len(data), name)
    finally:
        if path is not None:
            Path(path).unlink()


def read_image(path: Path) -> NDArray[np.uint8]:
    """Return `decode_image` of the file at `path`. Raises InputError."""
    try:
        data = read_file(Path(path))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    return decode_image(data, str(path))


def write_png(path: Path, pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> None:
    """Write `pixels` [H, W] or [H, W, 1 to 4], uint8 or uint16, unconverted and atomically. Row 0 becomes the top row.

    Raises InputError where the file cannot be written, ValueError for another shape or type.
    """
    path = Path(path)
    image = pixels[..., None] if pixels.ndim == 2 else pixels
    if image.ndim != 3 or not 1 <= image.shape[2] <= 4 or image.size == 0 or image.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"pixels must be [H, W, 1 to 4] uint8 or uint16, not {pixels.shape} {pixels.dtype}")
    spec = OpenImageIO.ImageSpec(image.shape[1], image.shape[0], image.shape[2], str(image.dtype))
    spec.attribute("oiio:UnassociatedAlpha", 1)
    if path.suffix.lower() != ".png":
        raise ValueError(f"{path}: the name of a PNG ends in .png")
    write_image(path, np.ascontiguousarray(image), spec)


# The type is quoted, because nanobind reports types that annotations hold at exit as leaks.
def write_image(path: Path, pixels: NDArray[Any], spec: "OpenImageIO.ImageSpec") -> None:
    """Write `pixels` [H, W, C] as `spec` says, atomically, in the format of the name's suffix.

    Raises InputError where the file cannot be written.
    """
    with atomic_path(path) as temporary:
        output = OpenImageIO.ImageOutput.create(str(temporary))
        if output is None or not output.open(str(temporary), spec):
            raise InputError(
                f"{path}: cannot be written ({OpenImageIO.geterror() if output is None else output.geterror()})"
            )
        written = output.write_image(pixels)
        message = "" if written else output.geterror()
        closed = output.close()
        if not (written and closed):
            raise InputError(f"{path}: cannot be written ({message or 'disk full?'}); check space and permissions")


def is_constant(pixels: NDArray[np.uint8]) -> bool:
    """Return whether all texels of `pixels` [H, W, C] are equal."""
    # Most images vary within the first row, so the whole image is rarely compared.
    return bool((pixels[0] == pixels[0, 0]).all()) and bool((pixels == pixels[0, 0]).all())


def split_alpha(pixels: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.uint8] | None]:
    """Return (RGB [H, W, 3], alpha [H, W]) of `pixels`. Alpha is None where there is none or all of it is 255."""
    if pixels.shape[2] < 4 or bool((pixels[..., 3] == 255).all()):
        return np.ascontiguousarray(pixels[..., :3]), None
    return np.ascontiguousarray(pixels[..., :3]), np.ascontiguousarray(pixels[..., 3])


def _is_image(path: Path) -> bool:
    return path.suffix.lower() in IMAGE_SUFFIXES and not is_partial(path) and path.is_file()


def has_images(folder: Path) -> bool:
    """Return whether `folder` or a sub-folder holds an image file."""
    return any(_is_image(path) for path in folder.rglob("*"))


def folder_images(folder: Path) -> list[Path]:
    """Return the image files in `folder` and its sub-folders, ordered by path. Raises InputError where there are none."""
    if not folder.is_dir():
        raise InputError(f"{folder}: not a folder; give one that holds images")
    paths = sorted(path for path in folder.rglob("*") if _is_image(path))
    if not paths:
        raise InputError(f"{folder}: holds no images (PNG, JPEG, WebP ...)")
    return paths


def folder_textures(folder: Path) -> tuple[SourceTexture, ...]:
    """Return all images in `folder` and its sub-folders as sRGB textures, ordered by path; constant images are left out.

    The category is the name of the sub-folder, None for images that lie in `folder` itself; the name is the path
    inside `folder` without suffix. Alpha is a fourth channel unless all of it is 255. Raises InputError.
    """
    folder = Path(folder)
    paths = folder_images(folder)

    def read(path: Path) -> SourceTexture | None:
        pixels = read_image(path)
        color, alpha = split_alpha(pixels)
        if alpha is None:
            pixels = color
        if is_constant(pixels):
            return None
        place = path.relative_to(folder)
        category = place.parent.name or None
        return SourceTexture(place.with_suffix("").as_posix(), pixels, hash_pixels(pixels), category=category)

    return tuple(texture for texture in map_in_threads(read, paths) if texture is not None)


def reduced_size(width: int, height: int, size: int) -> tuple[int, int]:
    """Return (width, height) scaled down with the same aspect until neither exceeds `size`; at least 1 x 1."""
    longest = max(width, height)
    if longest <= size:
        return width, height
    return max(1, math.floor(width * size / longest + 0.5)), max(1, math.floor(height * size / longest + 0.5))
