"""Base colour images: decoded on all cores, shared by their pixels; constant ones become factors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import PurePosixPath
from threading import Lock
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from ntc.codec.color import srgb_to_linear
from ntc.codec.textures import hash_pixels
from ntc.errors import InputError
from viewer.scene.gltf.buffers import Buffers, read_uri, resolve_uri
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.materials import MaterialSource
from viewer.scene.images import LARGE_EXPANSION, decode_image, is_constant, map_in_threads, split_alpha
from viewer.scene.model import Material, SceneTexture
from viewer.scene.report import ReportNotes

FREE_PIXEL_BYTES = 1 << 29
"""Bytes of pixels that any scene may keep, however small its images are as files; beyond, LARGE_EXPANSION holds."""
FREE_DECODED_BYTES = 1 << 32
"""The same for all that is decoded, constant images too, which are not kept but take time."""


@dataclass(frozen=True, eq=False)
class _DecodedImage:
    """One image of the file; `failure` says why there are no pixels."""

    name: str
    origin: str
    pixels: NDArray[np.uint8] | None = None
    alpha: NDArray[np.uint8] | None = None
    pixel_hash: str = ""
    constant: tuple[float, float, float, float] | None = None
    """Linear RGBA when all texels are equal."""
    failure: str = ""


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


class _Budget:
    """Limits decoded bytes, counted from several threads, to a proportion of the bytes of the image files."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._kept = self._decoded = self._file_bytes = 0

    def check(self) -> None:
        """Raises _TooManyPixelsError where too much was decoded so far, before yet another image is."""
        allowed = LARGE_EXPANSION * self._file_bytes
        if self._kept > FREE_PIXEL_BYTES + allowed or self._decoded > FREE_DECODED_BYTES + allowed:
            raise _TooManyPixelsError

    def add(self, byte_count: int, pixels: NDArray[np.uint8], kept: bool) -> None:
        """Count an image file of `byte_count` bytes. Raises _TooManyPixelsError."""
        with self._lock:
            self._decoded += pixels.nbytes
            self._kept += pixels.nbytes if kept else 0
            self._file_bytes += byte_count
        self.check()


class _TooManyPixelsError(Exception):
    """The images of a scene decode to too many bytes for the size of their files."""


def _names(file: GltfFile, index: int) -> tuple[str, str]:
    """(name, origin) of image `index`."""
    entry = file.entries("images")[index]
    uri = entry.get("uri")
    external = isinstance(uri, str) and uri[:5].lower() != "data:"
    path = file.label({"name": unquote(uri)}, "") if external and isinstance(uri, str) else ""
    stem = PurePosixPath(path.replace("\\", "/")).stem
    name = file.label(entry, stem or f"image {index}")
    return name, path or (f"{name} (embedded)" if name == f"image {index}" else f"image {index} {name!r} (embedded)")


def _decode(file: GltfFile, buffers: Buffers, index: int, reads_alpha: bool, budget: _Budget) -> _DecodedImage:
    budget.check()
    name, origin = _names(file, index)
    try:
        data = _image_bytes(file, buffers, index)
        decoded = decode_image(data, f"{file.name}: images[{index}] ({origin})")
        pixels, alpha = split_alpha(decoded)
    except InputError as error:
        return _DecodedImage(name, origin, failure=str(error))
    if not reads_alpha:
        alpha = None
    whole = pixels if alpha is None else np.dstack([pixels, alpha])
    constant = is_constant(whole)
    budget.add(len(data), decoded, kept=not constant)
    if constant:
        red, green, blue = (float(value) for value in srgb_to_linear(pixels[0, 0] / 255.0))
        color = (red, green, blue, 1.0 if alpha is None else float(alpha[0, 0]) / 255.0)
        return _DecodedImage(name, origin, constant=color)
    return _DecodedImage(name, origin, pixels, alpha, hash_pixels(whole))


def _decode_all(file: GltfFile, buffers: Buffers, reads_alpha: dict[int, bool]) -> dict[int, _DecodedImage]:
    """The images that are the keys of `reads_alpha`, each source decoded once. Raises InputError."""
    first: dict[tuple[tuple[str, Any], bool], int] = {}
    of_image = {index: first.setdefault((_source(file, index), alpha), index) for index, alpha in reads_alpha.items()}
    for index in first.values():
        # Buffers are not made for threads: read those that images lie in before the pool starts.
        _touch_buffer(file, buffers, index)
    budget = _Budget()
    try:
        decoded = map_in_threads(
            lambda index: _decode(file, buffers, index, reads_alpha[index], budget), list(first.values())
        )
    except _TooManyPixelsError as error:
        raise file.fail("images", "hold too many texels for the bytes there are; the scene is broken") from error
    by_first = dict(zip(first.values(), decoded, strict=True))
    return {index: by_first[source] for index, source in of_image.items()}


def _unique(name: str, taken: dict[str, int]) -> str:
    """`name`, or with the first number behind it that is free; `taken` holds names and the number to try next."""
    candidate, number = name, taken.get(name, 1)
    while candidate in taken:
        number += 1
        candidate = f"{name}_{number}"
    taken[name] = number
    taken[candidate] = max(1, taken.get(candidate, 1))
    return candidate


def _texture_table(
    images: dict[int, _DecodedImage], categories: dict[int, str | None], notes: ReportNotes
) -> tuple[tuple[SceneTexture, ...], dict[int, int]]:
    """(textures, texture id of each image that has one), in the order of `images`."""
    textures: list[SceneTexture] = []
    by_hash: dict[str, int] = {}
    ids: dict[int, int] = {}
    taken: dict[str, int] = {}
    for index, image in images.items():
        if image.pixels is None:
            continue
        if image.pixel_hash in by_hash:
            ids[index] = by_hash[image.pixel_hash]
            notes.note("images with the pixels of another share its texture")
            continue
        ids[index] = by_hash[image.pixel_hash] = len(textures)
        textures.append(
            SceneTexture(
                name=_unique(image.name, taken),
                pixels=image.pixels,
                alpha=image.alpha,
                pixel_hash=image.pixel_hash,
                origin=image.origin,
                category=categories[index],
            )
        )
    return tuple(textures), ids


def _finished(source: MaterialSource, image: _DecodedImage | None, texture_id: int) -> Material:
    if image is None or image.constant is None:
        return replace(source.material, texture_id=texture_id)
    red, green, blue, alpha = (f * c for f, c in zip(source.material.factor, image.constant, strict=True))
    return replace(source.material, factor=(red, green, blue, alpha))


def read_images(
    file: GltfFile, buffers: Buffers, sources: Sequence[MaterialSource], drawn: frozenset[int], notes: ReportNotes
) -> tuple[tuple[Material, ...], tuple[SceneTexture, ...]]:
    """The finished materials, in the order of `sources`, and the textures, in the order in which materials use them.

    Only images of the materials `drawn` are read. An image that is missing or broken is reported, and the factor
    stands for it; an image of one colour is multiplied into the factor.
    """
    using = [(source.image, source) for i, source in enumerate(sources) if i in drawn and source.image is not None]
    reads_alpha: dict[int, bool] = {}
    categories: dict[int, str | None] = {}
    for index, source in using:
        reads_alpha[index] = reads_alpha.get(index, False) or source.reads_alpha
        categories[index] = categories.get(index) or source.category
    images = _decode_all(file, buffers, reads_alpha)
    decoded = list({id(image): image for image in images.values()}.values())
    for image in decoded:
        if image.failure:
            reason = image.failure.removeprefix(f"{file.name}: ")
            notes.missing(f"{reason} [the factor is used]")
    for index in range(len(file.entries("images"))):
        if index not in images:
            _note_absent(file, index, notes)
    notes.note("constant images became factors", sum(image.constant is not None for image in decoded))
    notes.honoured("alpha of textures kept as plain textures", sum(image.alpha is not None for image in decoded))
    textures, ids = _texture_table(images, categories, notes)
    materials = tuple(
        _finished(source, images.get(source.image), ids.get(source.image, -1))
        if source.image is not None and number in drawn
        else source.material
        for number, source in enumerate(sources)
    )
    return materials, textures


def _note_absent(file: GltfFile, index: int, notes: ReportNotes) -> None:
    """Report a file that the scene names but nothing here needs (a normal map, say) when it is not there."""
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
        notes.missing(f"images[{index}]: {_names(file, index)[1]} is not there [no base colour reads it]")


def _touch_buffer(file: GltfFile, buffers: Buffers, image: int) -> None:
    view = file.entries("images")[image].get("bufferView")
    if view is not None:
        try:
            buffers.view(view, f"images[{image}].bufferView")
        except InputError:
            return  # Met again, and reported, where the image is decoded.
