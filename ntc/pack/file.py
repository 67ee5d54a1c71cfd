"""Reading and writing `.ntc` files: safetensors with JSON metadata (docs/reference/pack-format.md).

Files are read whole (`ntc.io.read_file`), not mapped: if another process truncated a mapped file, this process would crash.
"""

import json
import math
import os
import re
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, BinaryIO, TypeVar

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray
from safetensors import SafetensorError, deserialize
from safetensors.numpy import save

from ntc.codec.codec import TensorShape
from ntc.codec.model import Decoder, EncodedTexture, Grouping, Pack
from ntc.codec.registry import codec_of
from ntc.errors import FormerFormatError, InputError, MetadataError
from ntc.io import LENGTH_BYTES, file_metadata, read_file, write_bytes
from ntc.pack.other_formats import beginning_of, refuse_other_formats
from ntc.pack.schema import METADATA_KEY, PackMetadata, TextureMetadata, metadata_json, parse_metadata

T = TypeVar("T")
_Tensors = Mapping[str, Mapping[str, Any]]
"""Tensors by name: "dtype", "shape" and "data". safetensors has checked them against each other and the file's length."""
NUMPY_TYPES: dict[str, np.dtype[Any]] = {
    "U8": np.dtype("u1"),
    "I8": np.dtype("i1"),
    "F16": np.dtype("<f2"),
    "F32": np.dtype("<f4"),
}
_deserialize: Callable[[bytes], list[tuple[str, Mapping[str, Any]]]] = deserialize
REMEDY = "the pack is damaged or not one of ntc-viewer's; encode it again"


def expected_tensors(metadata: PackMetadata) -> dict[str, TensorShape]:
    """Return the type and shape of each tensor of a file with `metadata`. It must hold all of them and no others."""
    codec, expected = codec_of(metadata.codec), dict[str, TensorShape]()
    for index, texture in enumerate(metadata.textures):
        expected |= _numbered(codec.texture_shapes(metadata.codec, texture.width, texture.height), index)
    decoder = codec.decoder_shapes(metadata.codec)
    # A file holds no decoder if all textures use one that ships with the program.
    for index in range(codec.stored_decoders(metadata.grouping.name, metadata.decoders, metadata.codec)):
        expected |= _numbered(decoder, index)
    return expected


def _numbered(parts: Mapping[str, T], index: int) -> dict[str, T]:
    """Return `parts` with the number `index` of a texture or decoder put into their names."""
    return {name.format(index): part for name, part in parts.items()}


def pack_tensors(pack: Pack) -> dict[str, NDArray[Any]]:
    """Return the tensors that the file of `pack` holds, by name."""
    codec, tensors = codec_of(pack.config), dict[str, NDArray[Any]]()
    for index, texture in enumerate(pack.textures):
        tensors |= _numbered(codec.texture_tensors(texture, pack.config), index)
    stored = codec.stored_decoders(pack.grouping.name, len(pack.decoders), pack.config)
    for index, decoder in enumerate(pack.decoders[:stored]):
        tensors |= _numbered(codec.decoder_tensors(decoder, pack.config), index)
    return tensors


def pack_bytes(pack: Pack) -> bytes:
    """Return the bytes of the file of `pack`. The same pack gives the same bytes."""
    return bytes(save(pack_tensors(pack), metadata={METADATA_KEY: metadata_json(pack)}))


def write_pack(path: Path, pack: Pack) -> None:
    """Write `pack` to `path` atomically. Raises InputError if that fails."""
    write_bytes(path, pack_bytes(pack))


def _check_header(file: _Tensors, metadata: PackMetadata, path: Path) -> None:
    expected = expected_tensors(metadata)
    present = set(file)
    missing, surplus = sorted(expected.keys() - present), sorted(present - expected.keys())
    if missing:
        raise InputError(f"{path}: tensor {missing[0]} is missing ({len(missing)} in all); {REMEDY}")
    if surplus:
        raise InputError(f"{path}: tensor {surplus[0]!r} does not belong there ({len(surplus)} in all); {REMEDY}")
    for name, (kind, shape) in expected.items():
        part = file[name]
        fits = len(part["shape"]) == len(shape) and all(
            size in (None, stored) for stored, size in zip(part["shape"], shape, strict=True)
        )
        if part["dtype"] != kind or not fits:
            actual = f"{part['dtype']} {part['shape']}"
            wanted = ", ".join("any" if size is None else str(size) for size in shape)
            raise InputError(f"{path}: tensor {name} is {actual}, expected {kind} [{wanted}]; {REMEDY}")


def _tensor(file: _Tensors, name: str, path: Path) -> NDArray[Any]:
    array: NDArray[Any] = np.frombuffer(file[name]["data"], NUMPY_TYPES[file[name]["dtype"]]).reshape(
        file[name]["shape"]
    )
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise InputError(f"{path}: tensor {name} holds NaN or infinity; {REMEDY}")
    return array


def _read(file: _Tensors, metadata: PackMetadata, path: Path) -> Pack:
    config, codec = metadata.codec, codec_of(metadata.codec)
    decoder_parts = codec.decoder_shapes(config)

    def part(names: Iterable[str], index: int, read: Callable[[Mapping[str, NDArray[Any]]], T]) -> T:
        tensors = {name: _tensor(file, name.format(index), path) for name in names}
        try:
            return read(tensors)
        except ValueError as error:
            raise InputError(f"{path}: tensor {str(error).replace('{}', str(index))}; {REMEDY}") from error

    def texture(index: int, described: TextureMetadata, group: int) -> EncodedTexture:
        known = {**msgspec.structs.asdict(described), "group": group}
        names = codec.texture_shapes(config, described.width, described.height)
        return part(names, index, lambda tensors: codec.read_texture(tensors, known, config))

    members = enumerate(zip(metadata.textures, metadata.grouping.groups, strict=True))
    textures = tuple(texture(index, described, group) for index, (described, group) in members)
    decoders: tuple[Decoder, ...]
    if codec.stored_decoders(metadata.grouping.name, metadata.decoders, config) < metadata.decoders:
        parameters = metadata.grouping.parameters
        decoders = (part((), 0, lambda _: codec.shipped_decoder(metadata.decoders, parameters, config)),)
    else:
        decoders = tuple(
            part(decoder_parts, index, lambda tensors: codec.read_decoder(tensors, config))
            for index in range(metadata.decoders)
        )
    grouping = Grouping(**msgspec.structs.asdict(metadata.grouping))
    return Pack(config, grouping, textures, decoders, metadata.training, path)


def checked_pack(file: _Tensors, metadata: PackMetadata, path: Path) -> Pack:
    """Return the pack that tensors `file` (by name: "dtype", "shape", "data") and `metadata` make, read from `path`.

    Raises InputError if tensors do not fit the metadata, or hold values that no pack may hold.
    """
    _check_header(file, metadata, path)
    return _read(file, metadata, path)


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Turn every error of reading a pack into an InputError with one line that names the file."""
    try:
        yield
    except SafetensorError as error:
        raise InputError(f"{path}: not a safetensors file ({error}); {REMEDY}") from error
    except FormerFormatError as error:
        raise InputError(f"{path}: {error}") from error
    except MetadataError as error:
        raise InputError(f"{path}: {error}; {REMEDY}") from error
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"{path}: cannot be read ({reason}); check its path and permissions") from error
    except MemoryError as error:
        raise InputError(f"{path}: takes more memory than there is; encode at a smaller --texture-size") from error


def read_pack(path: Path) -> Pack:
    """Read a pack and check its types, shapes, indices and finiteness. Raises InputError with one line.

    safetensors compares shapes with the file's length, so memory use is proportional to that length.
    """
    # Callers of the library may name it as text.
    path = Path(path)
    return parsed_pack(path, pack_file(path))


def pack_file(path: Path) -> bytes:
    """Return the bytes of a file that may be a pack. Raises InputError."""
    with _reading(path):
        _refuse_others(path)
        return read_file(path)


def _refuse_others(path: Path) -> None:
    """Raises InputError for what is obviously no pack."""
    if not path.is_file():
        raise InputError(f"{path}: {'is a folder' if path.is_dir() else 'no such file'}; name a .ntc pack")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty; {REMEDY}")
    refuse_other_formats(path, beginning_of(path))


def parsed_pack(path: Path, data: bytes) -> Pack:
    """Return the pack whose file at `path` holds `data`, as `read_pack` does. Raises InputError."""
    with _reading(path):
        file = dict(_deserialize(data))
        text = file_metadata(data).get(METADATA_KEY)
        if text is None:
            raise InputError(f"{path}: has no {METADATA_KEY!r} metadata; {REMEDY}")
        return checked_pack(file, parse_metadata(text), path)


LARGEST_HEADER = 100_000_000
"""Largest header in bytes: the limit of safetensors."""
_INDEXED = re.compile(r"(latents|adapter|decoder)\.(0|[1-9][0-9]{0,8})(\..+)?")
_Natural = Annotated[int, Meta(ge=0)]


class _Place(msgspec.Struct, frozen=True):
    """Header entry of one tensor: type, shape, and place in the file."""

    dtype: str
    shape: list[_Natural]
    data_offsets: tuple[_Natural, _Natural]

    @property
    def fits(self) -> bool:
        """True if the tensor's number of bytes fits its shape and type."""
        begin, end = self.data_offsets
        return self.dtype in NUMPY_TYPES and end - begin == math.prod(self.shape) * NUMPY_TYPES[self.dtype].itemsize


def _header(file: BinaryIO, path: Path) -> tuple[dict[str, _Place], PackMetadata, int]:
    """Return (header entries by name, metadata, offset of the first tensor's bytes). Raises InputError, MetadataError."""
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    length = int.from_bytes(file.read(LENGTH_BYTES), "little")
    begin = LENGTH_BYTES + length
    if length > LARGEST_HEADER or begin > size:
        raise InputError(f"{path}: not a safetensors file (its header does not fit its length); {REMEDY}")
    try:
        header = json.loads(file.read(length))
        text = header.pop("__metadata__")[METADATA_KEY]
        tensors = msgspec.convert(header, dict[str, _Place])
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise InputError(f"{path}: the header is not that of a pack; {REMEDY}") from error
    end = 0
    for name, place in sorted(tensors.items(), key=lambda item: item[1].data_offsets):
        # Tensors must follow each other: if they shared bytes, they would take more memory than the file.
        if place.data_offsets[0] != end or not place.fits:
            raise InputError(f"{path}: tensor {name!r} does not fit its shape or its place; {REMEDY}")
        end = place.data_offsets[1]
    if begin + end != size:
        raise InputError(f"{path}: has {size} bytes, its header names {begin + end}; {REMEDY}")
    return tensors, parse_metadata(text), begin


def pack_contents(file: BinaryIO, path: Path) -> tuple[PackMetadata, list[int]]:
    """Return (metadata, bytes of each texture's latents) from the header of the open pack `file`. Error messages name `path`.

    Raises InputError with one line.
    """
    with _reading(path):
        places, metadata, _ = _header(file, path)
    stored_bytes = [0] * len(metadata.textures)
    for name, place in places.items():
        parts = _INDEXED.fullmatch(name)
        if parts and parts[1] == "latents" and int(parts[2]) < len(stored_bytes):
            stored_bytes[int(parts[2])] += place.data_offsets[1] - place.data_offsets[0]
    return metadata, stored_bytes


def read_metadata(path: Path) -> PackMetadata:
    """Return what the header of a pack says, without reading its tensors. Raises InputError."""
    with _reading(path):
        _refuse_others(path)
        with path.open("rb") as file:
            return pack_contents(file, path)[0]


def _chosen(metadata: PackMetadata, wanted: Container[str]) -> tuple[PackMetadata, dict[str, dict[int, int]]]:
    """Return (metadata of the wanted textures, new numbers by kind of tensor and old number)."""
    textures = [index for index, each in enumerate(metadata.textures) if each.pixel_hash in wanted]
    used = {metadata.grouping.groups[index] for index in textures}
    # A pack whose decoders ship with the program has all of them, for any textures.
    stored = codec_of(metadata.codec).stored_decoders(metadata.grouping.name, metadata.decoders, metadata.codec)
    groups_read = sorted(used) if stored else range(metadata.decoders)
    new_groups = {group: number for number, group in enumerate(groups_read)}
    new_textures = {index: number for number, index in enumerate(textures)}
    groups = tuple(new_groups[metadata.grouping.groups[index]] for index in textures)
    fewer = replace(
        metadata,
        grouping=msgspec.structs.replace(metadata.grouping, groups=groups),
        decoders=len(new_groups),
        textures=tuple(metadata.textures[index] for index in textures),
    )
    return fewer, {"latents": new_textures, "adapter": new_textures, "decoder": new_groups}


def read_textures(path: Path, wanted: Container[str]) -> Pack:
    """Return the pack at `path` with only the textures whose pixel hash is in `wanted`, and their decoders.

    The checks are those of `read_pack`. Raises InputError with one line, also if the pack holds no wanted texture.
    """
    path = Path(path)
    with _reading(path), path.open("rb") as file:
        places, metadata, begin = _header(file, path)
        fewer, numbers = _chosen(metadata, wanted)
        if not fewer.textures:
            raise InputError(f"{path}: holds none of the wanted textures")
        tensors: dict[str, Mapping[str, Any]] = {}
        for name, place in places.items():
            parts = _INDEXED.fullmatch(name)
            number = numbers[parts[1]].get(int(parts[2])) if parts else None
            if parts is None or number is None:
                continue
            file.seek(begin + place.data_offsets[0])
            data = file.read(place.data_offsets[1] - place.data_offsets[0])
            named = f"{parts[1]}.{number}{parts[3] or ''}"
            tensors[named] = {"dtype": place.dtype, "shape": place.shape, "data": data}
        return checked_pack(tensors, fewer, path)
