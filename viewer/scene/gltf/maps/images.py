"""Images of the file, split into the maps that materials read: on all cores, with bounds on memory."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from threading import Lock
from typing import Any
from urllib.parse import unquote

import numpy as np
from msgspec import UnsetType
from numpy.typing import NDArray

from ntc.codec.maps import TABLE_OF_MAP, MapName
from ntc.codec.mips import srgb_to_linear
from ntc.codec.textures import hash_pixels
from ntc.errors import InputError
from ntc.io import read_file
from viewer.scene.gltf.buffers import Buffers, is_data_uri, read_uri, resolve_uri
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.maps.packed_pixels import PackedTextures
from viewer.scene.gltf.materials import MaterialSource
from viewer.scene.gltf.packed_textures import PACK_MIME_TYPE, PackOption, packed_image
from viewer.scene.gltf.schema import ABSENT, Image
from viewer.scene.images import (
    LARGE_EXPANSION,
    ProgressReport,
    decode_image,
    is_constant,
    map_in_threads,
    split_alpha,
)
from viewer.scene.pixels import FactsFile, ImageContent, ImageFacts, MapFacts, PixelCache
from viewer.scene.report import ReportNotes

FLAT = ((127, 127), (127, 128), (128, 127), (128, 128))
"""Normal xy of an even surface: 0 lies between two of the 256 steps."""
MIDDLE = 127.5
SHORTEST, LONGEST = 0.9, 1.1
"""Range of lengths of stored normals that rounding explains. Others are normalised before z is dropped."""
ROWS = 256
"""Rows of an image that are examined together."""


def _unit_normals(image: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], int]:
    """Return (xy [H, W, 2] of the normals in `image` [H, W, 3 or 4]; number of texels whose normal was far from unit length).

    Renderers normalise what they sample (glTF 2.0, Sec. 3.9). Here z is dropped and rebuilt from xy, so xy must be those of the
    unit normal. Normals far from unit length that also point into the surface become even ones. An image whose blue is constant
    holds xy alone and is returned as it is.
    """
    normal = np.ascontiguousarray(image[..., :2])
    blue = image[..., 2]
    if bool((blue == blue[0, 0]).all()):
        return normal, 0
    changed = 0
    for start in range(0, len(image), ROWS):
        vectors = (image[start : start + ROWS, :, :3].astype(np.float32) - np.float32(MIDDLE)) / np.float32(MIDDLE)
        lengths = np.sqrt(np.einsum("hwc,hwc->hw", vectors, vectors))
        far = ((lengths < SHORTEST) | (lengths > LONGEST)) & (lengths > 0.05)
        count = int(far.sum())
        if count:
            changed += count
            unit = vectors[far][:, :2] / lengths[far][:, None]
            # Black texels are common, mostly where no triangle shows them.
            unit[vectors[far][:, 2] < 0] = 0.0
            normal[start : start + ROWS][far] = np.floor(unit * MIDDLE + MIDDLE + 0.5).astype(np.uint8)
    return normal, changed


def map_channels(name: MapName, image: NDArray[np.uint8]) -> tuple[NDArray[np.uint8] | None, str]:
    """Return ([H, W, channels] uint8 of map `name` in `image` [H, W, 3 or 4], None where it is not usable; its fault, or "")."""
    if name != "normal":
        channels = TABLE_OF_MAP[name].gltf_channels
        return np.ascontiguousarray(image[..., channels[0] : channels[-1] + 1]), ""
    if not is_constant(image[..., :3]) and all(bool((image[..., k] == image[..., 0]).all()) for k in (1, 2)):
        return None, "is grey, no normals are in it; left out"
    pixels, changed = _unit_normals(image)
    if not changed:
        return pixels, ""
    share = 100.0 * changed / (pixels.shape[0] * pixels.shape[1])
    return pixels, f"has normals far from unit length, which were normalised: {share:.3g} % of its texels"


def map_facts(name: MapName, pixels: NDArray[np.uint8] | None, remark: str) -> MapFacts:
    """Return the facts of a map, from the pixels and the remark that `map_channels` returns."""
    if pixels is None:
        return MapFacts(remark=remark)
    if not is_constant(pixels):
        return MapFacts(hash_pixels(pixels), None, remark)
    constant = tuple(int(value) for value in pixels[0, 0])
    if name == "normal" and constant not in FLAT:
        return MapFacts(remark="has one normal that is not upright; left out")
    return MapFacts(constant=constant, remark=remark)


def resampled(pixels: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """Return [height, width, C] uint8: `pixels` [H, W, C] sampled bilinearly at texel centres, clamped at the borders."""
    for axis, size in ((0, height), (1, width)):
        count = pixels.shape[axis]
        if count == size:
            continue
        at = np.clip((np.arange(size) + 0.5) * (count / size) - 0.5, 0.0, count - 1.0)
        low = np.floor(at).astype(np.int64)
        share = (at - low).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        lower, upper = pixels.take(low, axis), pixels.take(np.minimum(low + 1, count - 1), axis)
        pixels = np.floor(lower + share * (upper.astype(np.float32) - lower) + np.float32(0.5)).astype(np.uint8)
    return pixels


FREE_PIXEL_BYTES = 1 << 29
"""Bytes of pixels that any scene may keep, however small its image files are. Beyond, LARGE_EXPANSION limits them."""
FREE_DECODED_BYTES = 1 << 32
"""Bytes that any scene may decode, with images that turn out constant: they take time, but no memory."""
NO_FACTS = ImageFacts((0, 0), 0, 0)


@dataclass(frozen=True, eq=False)
class SceneImage:
    """Image of the file. `failure` says why it has no pixels."""

    name: str
    origin: str
    facts: ImageFacts = NO_FACTS
    failure: str = ""
    read: Callable[[], ImageContent] = ImageContent
    """Reader of the pixels, from memory or from the file. Raises InputError."""
    packed_hash: str = ""
    """Identity of the texture of a pack that it is decoded from; "" for an image file."""


@dataclass
class ImageUse:
    """Maps of an image that materials read, and whether they read its alpha."""

    maps: set[MapName] = field(default_factory=set)
    alpha: bool = False
    category: str | None = None


class PixelBudget:
    """Limit of decoded bytes in proportion to the bytes of the image files. Threads may count at the same time."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._retained = self._decoded = self._file_bytes = 0

    def check(self) -> None:
        """Refuse to decode another image when the limit is exceeded. Raises TooManyPixelsError."""
        allowed = LARGE_EXPANSION * self._file_bytes
        if self._retained > FREE_PIXEL_BYTES + allowed or self._decoded > FREE_DECODED_BYTES + allowed:
            raise TooManyPixelsError

    def add(self, byte_count: int, decoded: int, retained: int) -> None:
        """Count an image file of `byte_count` bytes, its bytes `decoded`, and those `retained`. Raises TooManyPixelsError."""
        with self._lock:
            self._decoded += decoded
            self._retained += retained
            self._file_bytes += byte_count
        self.check()


class TooManyPixelsError(Exception):
    """Error of a scene whose images decode to too many bytes for the size of their files."""


@dataclass(frozen=True, eq=False)
class _ImageFile:
    """Bytes of an image: embedded, or in a file."""

    data: bytes | memoryview | None = None
    """Bytes of an embedded image."""
    path: Path | None = None
    keeps: object = None
    """Object that keeps `path` on disk until it is read."""

    def read(self, label: str) -> bytes:
        """Return the bytes. Raises InputError."""
        if self.data is not None:
            return bytes(self.data)
        assert self.path is not None
        try:
            return read_file(self.path)
        except OSError as error:
            raise InputError(f"{label}: can no longer be read ({error.strerror}); open the scene again") from error


def _image_file(file: GltfFile, buffers: Buffers, index: int) -> tuple[_ImageFile, bytes]:
    """Return (source of image `index` to read it again, its bytes). Raises InputError."""
    entry, where = file.entry("images", index, Image), f"images[{index}]"
    if not isinstance(entry.uri, UnsetType):
        data = read_uri(file, entry.uri, f"{where}.uri")
        path = None if is_data_uri(entry.uri) else resolve_uri(file, entry.uri, f"{where}.uri")
        return (_ImageFile(data) if path is None else _ImageFile(path=path, keeps=file.keeps)), data
    if entry.buffer_view != ABSENT:
        # A view, not a copy: views of one buffer may overlap, and copies of them could exceed the file.
        view = buffers.view(entry.buffer_view, f"{where}.bufferView")[0]
        return _ImageFile(view.data), view.tobytes()
    raise file.fail(where, "has neither a uri nor a bufferView")


def image_bytes(file: GltfFile, buffers: Buffers, index: int) -> bytes:
    """Return the bytes of image `index` in its file format. Raises InputError."""
    return _image_file(file, buffers, index)[1]


def _source(file: GltfFile, index: int) -> tuple[str, Any]:
    """Return the identity of the source of image `index`. Images with the same source are decoded once."""
    entry = file.entries("images")[index]
    for key in ("uri", "bufferView"):
        if key in entry:
            return key, entry[key] if isinstance(entry[key], str | int) else index
    return "image", index


def _names(file: GltfFile, index: int) -> tuple[str, str]:
    """Return (name, origin) of image `index`."""
    entry = file.entries("images")[index]
    uri = entry.get("uri")
    external = isinstance(uri, str) and uri[:5].lower() != "data:"
    path = file.label({"name": unquote(uri)}, "") if external and isinstance(uri, str) else ""
    stem = PurePosixPath(path.replace("\\", "/")).stem
    name = file.label(entry, stem or f"image {index}")
    return name, path or (f"{name} (embedded)" if name == f"image {index}" else f"image {index} {name!r} (embedded)")


def image_uses(sources: Sequence[MaterialSource]) -> dict[int, ImageUse]:
    """Return the uses of each image by `sources`, by image: base colours first, in the order of their materials."""
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


def _split(decoded: NDArray[np.uint8], use: ImageUse) -> tuple[ImageContent, ImageFacts]:
    """Return (pixels that `use` reads of the image `decoded` [H, W, 3 or 4]; facts of the image)."""
    map_pixels: dict[MapName, NDArray[np.uint8]] = {}
    facts: dict[MapName, MapFacts] = {}
    for name in sorted(use.maps - {"base"}):
        pixels, remark = map_channels(name, decoded)
        facts[name] = map_facts(name, pixels, remark)
        if pixels is not None and facts[name].key:
            map_pixels[name] = pixels
    size = decoded.shape[1], decoded.shape[0]
    if "base" not in use.maps:
        content = ImageContent(maps=map_pixels)
        return content, ImageFacts(size, decoded.nbytes, content.nbytes, maps=facts)
    pixels, alpha = split_alpha(decoded)
    if not use.alpha:
        alpha = None
    whole = pixels if alpha is None else np.dstack([pixels, alpha])
    if is_constant(whole):
        red, green, blue = (float(value) for value in srgb_to_linear(pixels[0, 0] / 255.0))
        color = (red, green, blue, 1.0 if alpha is None else float(alpha[0, 0]) / 255.0)
        content = ImageContent(maps=map_pixels)
        return content, ImageFacts(size, decoded.nbytes, content.nbytes, constant=color, maps=facts)
    content = ImageContent(pixels, alpha, map_pixels)
    # The base colour counts with all channels of the file, also where its alpha is not read.
    retained = decoded.nbytes + sum(part.nbytes for part in map_pixels.values())
    return content, ImageFacts(size, decoded.nbytes, retained, hash_pixels(whole), alpha is not None, maps=facts)


def _read_again(data: bytes, label: str, facts: ImageFacts) -> ImageContent:
    """Return the pixels of an image whose facts are known. Raises InputError where its file is broken or of another size."""
    decoded = decode_image(data, label)
    if (decoded.shape[1], decoded.shape[0]) != facts.size:
        raise InputError(f"{label}: has changed since the scene was opened; open it again")
    maps: dict[MapName, NDArray[np.uint8]] = {}
    for name, known in facts.maps.items():
        channels = map_channels(name, decoded)[0] if known.key else None
        if channels is not None:
            maps[name] = channels
    if not facts.pixel_hash:
        return ImageContent(maps=maps)
    pixels, alpha = split_alpha(decoded)
    return ImageContent(pixels, alpha if facts.has_alpha else None, maps)


class ImageReader:
    """Reads the facts of a file's images, and their pixels again later."""

    def __init__(self, file: GltfFile, buffers: Buffers, facts: FactsFile, cache: PixelCache) -> None:
        self._file, self._buffers, self._facts, self.cache = file, buffers, facts, cache
        self._packed = PackedTextures(file, cache)
        self.budget = PixelBudget()

    def touch_buffer(self, image: int) -> None:
        """Read the buffer of an embedded image now, because `Buffers` may only be used by one thread."""
        view = self._file.entries("images")[image].get("bufferView")
        if view is not None:
            # `find_out` meets the same error, and reports it.
            with suppress(InputError):
                self._buffers.view(view, f"images[{image}].bufferView")

    def find_out(self, index: int, use: ImageUse) -> SceneImage:
        """Return image `index`, with facts from the cache or from its pixels. Raises TooManyPixelsError."""
        self.budget.check()
        name, origin = _names(self._file, index)
        label = f"{self._file.name}: images[{index}] ({origin})"
        option = packed_image(self._file, index)
        if option is not None:
            return self._in_pack(option, use, name)
        content: ImageContent | None = None
        try:
            place, data = _image_file(self._file, self._buffers, index)
            key = FactsFile.image_key(data, f"{'alpha ' if use.alpha else ''}{' '.join(sorted(use.maps))}")
            facts = self._facts.image(key)
            if facts is None:
                content, facts = _split(decode_image(data, label), use)
        except InputError as error:
            return SceneImage(name, origin, failure=str(error))
        self.budget.add(len(data), facts.decoded_bytes, facts.kept_bytes)
        # The reader below must not hold `self`, which would keep the file and its buffers in memory.
        number, known, cache = object(), facts, self.cache
        if content is not None:
            self._facts.add_image(key, facts)
            self.cache.offer(number, content)
        return SceneImage(
            name,
            origin,
            known,
            read=lambda: cache.get(number, lambda: _read_again(place.read(label), label, known)),
        )

    def _in_pack(self, option: PackOption, use: ImageUse, name: str) -> SceneImage:
        """Return an image whose pixels exist only in a pack."""
        packed = self._packed
        try:
            texture = packed.find(option)
        except InputError as error:
            return SceneImage(name, name, failure=str(error))
        origin = f"{texture.encoded.name} in {texture.pack.name}"
        return SceneImage(
            name,
            origin,
            texture.facts(use.maps),
            read=lambda: packed.decoded(texture),
            packed_hash=texture.encoded.pixel_hash,
        )


def find_images(
    file: GltfFile,
    uses: Mapping[int, ImageUse],
    reader: ImageReader,
    notes: ReportNotes,
    report: ProgressReport | None = None,
) -> dict[int, SceneImage]:
    """Return the images that `uses` names, in its order. Images that cannot be read are reported.

    Each source is read once (twice where one material reads its alpha and another does not). Raises TooManyPixelsError, and the
    exceptions of `report`.
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
        reader.touch_buffer(index)
    decoded = map_in_threads(lambda index: reader.find_out(index, merged[index]), list(first.values()), report)
    for index, image in zip(first.values(), decoded, strict=True):
        if image.failure:
            reason = image.failure.removeprefix(f"{file.name}: ")
            base = "base" in merged[index].maps
            notes.missing(f"{reason} [{'a magenta pattern times the factor is used' if base else 'factors are used'}]")
        for key, facts_of_map in image.facts.maps.items():
            if facts_of_map.remark:
                notes.note(f"{image.name}: {key} map {facts_of_map.remark}")
    by_first = dict(zip(first.values(), decoded, strict=True))
    return {index: by_first[source] for index, source in of_image.items()}


def note_absent(file: GltfFile, index: int, notes: ReportNotes) -> None:
    """Report a missing image file that nothing drawn needs."""
    entry = file.entries("images")[index]
    uri = entry.get("uri")
    if not isinstance(uri, str) or uri[:5].lower() == "data:" or entry.get("mimeType") == PACK_MIME_TYPE:
        return
    try:
        path = resolve_uri(file, uri, f"images[{index}].uri")
        absent = path is not None and not path.is_file()
    except (InputError, OSError, ValueError):
        absent = True
    if absent:
        notes.missing(f"images[{index}]: {_names(file, index)[1]} is not there [nothing that is drawn reads it]")
