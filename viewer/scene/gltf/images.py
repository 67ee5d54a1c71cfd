"""Images of the file, taken apart into the maps that materials read: decoded on all cores, with bounds on memory."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from threading import Lock
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from ntc.codec.color import srgb_to_linear
from ntc.codec.maps import MapName
from ntc.codec.textures import hash_pixels
from ntc.errors import InputError
from viewer.scene.gltf.buffers import Buffers, read_uri, resolve_uri
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.map_pixels import DecodedMap, decoded_map
from viewer.scene.gltf.materials import MaterialSource
from viewer.scene.images import LARGE_EXPANSION, decode_image, is_constant, map_in_threads, split_alpha
from viewer.scene.report import ReportNotes

FREE_PIXEL_BYTES = 1 << 29
"""Bytes of pixels that any scene may keep, however small its images are as files; beyond, LARGE_EXPANSION holds."""
FREE_DECODED_BYTES = 1 << 32
"""The same for all that is decoded, constant images too, which are not kept but take time."""


@dataclass(frozen=True, eq=False)
class DecodedImage:
    """One image of the file; `failure` says why there are no pixels."""

    name: str
    origin: str
    pixels: NDArray[np.uint8] | None = None
    """[H, W, 3] where a material reads it as base colour and it is not constant."""
    alpha: NDArray[np.uint8] | None = None
    pixel_hash: str = ""
    constant: tuple[float, float, float, float] | None = None
    """Linear RGBA when all texels are equal, and a material reads it as base colour."""
    maps: Mapping[MapName, DecodedMap] = field(default_factory=dict)
    """What materials read of it besides a base colour."""
    failure: str = ""


@dataclass
class ImageUse:
    """What materials read of an image."""

    maps: set[MapName] = field(default_factory=set)
    alpha: bool = False
    category: str | None = None


class PixelBudget:
    """Limits decoded bytes, counted from several threads, to a proportion of the bytes of the image files."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._kept = self._decoded = self._file_bytes = 0

    def check(self) -> None:
        """Raises TooManyPixelsError where too much was decoded so far, before yet another image is."""
        allowed = LARGE_EXPANSION * self._file_bytes
        if self._kept > FREE_PIXEL_BYTES + allowed or self._decoded > FREE_DECODED_BYTES + allowed:
            raise TooManyPixelsError

    def add(self, byte_count: int, decoded: int, kept: int) -> None:
        """Count an image file of `byte_count` bytes, and the bytes `decoded` and `kept`. Raises TooManyPixelsError."""
        with self._lock:
            self._decoded += decoded
            self._kept += kept
            self._file_bytes += byte_count
        self.check()


class TooManyPixelsError(Exception):
    """The images of a scene decode to too many bytes for the size of their files."""


def _image_bytes(file: GltfFile, buffers: Buffers, index: int) -> bytes:
    entry = file.entries("images")[index]
    where = f"images[{index}]"
    if "uri" in entry:
        return read_uri(file, file.text(entry, "uri", where), f"{where}.uri")
    if "bufferView" in entry:
        return buffers.view(entry["bufferView"], f"{where}.bufferView")[0].tobytes()
    raise file.fail(where, "has neither a uri nor a bufferView")


def _source(file: GltfFile, index: int) -> tuple[str, Any]:
    """What image `index` is read from: images with the same source are decoded once."""
    entry = file.entries("images")[index]
    for key in ("uri", "bufferView"):
        if key in entry:
            return key, entry[key] if isinstance(entry[key], str | int) else index
    return "image", index


def _names(file: GltfFile, index: int) -> tuple[str, str]:
    """(name, origin) of image `index`."""
    entry = file.entries("images")[index]
    uri = entry.get("uri")
    external = isinstance(uri, str) and uri[:5].lower() != "data:"
    path = file.label({"name": unquote(uri)}, "") if external and isinstance(uri, str) else ""
    stem = PurePosixPath(path.replace("\\", "/")).stem
    name = file.label(entry, stem or f"image {index}")
    return name, path or (f"{name} (embedded)" if name == f"image {index}" else f"image {index} {name!r} (embedded)")


def image_uses(sources: Sequence[MaterialSource]) -> dict[int, ImageUse]:
    """By image, what `sources` read of it: base colours first, in the order of their materials."""
    uses: dict[int, ImageUse] = {}
    for source in sources:
        if "base" in source.maps:
            reference = source.maps["base"]
            use = uses.setdefault(reference.image, ImageUse({"base"}))
            use.alpha = use.alpha or source.reads_alpha
            use.category = use.category or reference.category or source.category
    for source in sources:
        for name, reference in source.maps.items():
            if name != "base":
                use = uses.setdefault(reference.image, ImageUse())
                use.maps.add(name)
                use.category = use.category or reference.category or source.category
    return uses


def _decode(file: GltfFile, buffers: Buffers, index: int, use: ImageUse, budget: PixelBudget) -> DecodedImage:
    budget.check()
    name, origin = _names(file, index)
    try:
        data = _image_bytes(file, buffers, index)
        decoded = decode_image(data, f"{file.name}: images[{index}] ({origin})")
    except InputError as error:
        return DecodedImage(name, origin, failure=str(error))
    maps = {key: decoded_map(key, decoded) for key in sorted(use.maps - {"base"})}
    kept = sum(found.pixels.nbytes for found in maps.values() if found.pixels is not None)
    if "base" not in use.maps:
        budget.add(len(data), decoded.nbytes, kept)
        return DecodedImage(name, origin, maps=maps)
    pixels, alpha = split_alpha(decoded)
    if not use.alpha:
        alpha = None
    whole = pixels if alpha is None else np.dstack([pixels, alpha])
    constant = is_constant(whole)
    budget.add(len(data), decoded.nbytes, kept + (0 if constant else decoded.nbytes))
    if constant:
        red, green, blue = (float(value) for value in srgb_to_linear(pixels[0, 0] / 255.0))
        color = (red, green, blue, 1.0 if alpha is None else float(alpha[0, 0]) / 255.0)
        return DecodedImage(name, origin, constant=color, maps=maps)
    return DecodedImage(name, origin, pixels, alpha, hash_pixels(whole), maps=maps)


def decode_images(
    file: GltfFile, buffers: Buffers, uses: Mapping[int, ImageUse], budget: PixelBudget, notes: ReportNotes
) -> dict[int, DecodedImage]:
    """The images that are the keys of `uses`, in their order; those that fail are reported.

    Each source is decoded once (twice where one material reads its alpha and another does not). Raises TooManyPixelsError.
    """
    first: dict[tuple[tuple[str, Any], bool], int] = {}
    of_image: dict[int, int] = {}
    merged: dict[int, ImageUse] = {}
    for index, use in uses.items():
        source = _source(file, index)
        # A map may come from the same file as a base colour whose alpha is read.
        alpha = use.alpha or ("base" not in use.maps and (source, True) in first)
        of_image[index] = first.setdefault((source, alpha), index)
        whole = merged.setdefault(of_image[index], ImageUse(alpha=alpha))
        whole.maps |= use.maps
    for index in first.values():
        # Buffers are not made for threads: read those that images lie in before the pool starts.
        _touch_buffer(file, buffers, index)
    decoded = map_in_threads(lambda index: _decode(file, buffers, index, merged[index], budget), list(first.values()))
    for index, image in zip(first.values(), decoded, strict=True):
        if image.failure:
            reason = image.failure.removeprefix(f"{file.name}: ")
            base = "base" in merged[index].maps
            notes.missing(f"{reason} [{'the factor is used' if base else 'factors are used'}]")
        for key, found in image.maps.items():
            if found.remark:
                notes.note(f"{image.name}: {key} map {found.remark}")
    by_first = dict(zip(first.values(), decoded, strict=True))
    return {index: by_first[source] for index, source in of_image.items()}


def note_absent(file: GltfFile, index: int, notes: ReportNotes) -> None:
    """Report a file that the scene names but nothing drawn needs when it is not there."""
    entry = file.entries("images")[index]
    uri = entry.get("uri")
    if not isinstance(uri, str) or uri[:5].lower() == "data:":
        return
    try:
        path = resolve_uri(file, file.text(entry, "uri", f"images[{index}]"), f"images[{index}].uri")
        absent = path is not None and not path.is_file()
    except (InputError, OSError, ValueError):
        absent = True
    if absent:
        notes.missing(f"images[{index}]: {_names(file, index)[1]} is not there [nothing that is drawn reads it]")


def _touch_buffer(file: GltfFile, buffers: Buffers, image: int) -> None:
    view = file.entries("images")[image].get("bufferView")
    if view is not None:
        try:
            buffers.view(view, f"images[{image}].bufferView")
        except InputError:
            return  # Met again, and reported, where the image is decoded.
