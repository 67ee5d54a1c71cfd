"""Reading and writing `.ntc` files: safetensors with JSON metadata (docs/reference/pack-format.md).

Files are read whole (`ntc.io.read_file`), not mapped: a mapped file that another process shortens would end this one.
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
"""Tensors by name: "dtype", "shape" and "data", checked by safetensors against each other and the file's length."""
NUMPY_TYPES: dict[str, np.dtype[Any]] = {
    "U8": np.dtype("u1"),
    "I8": np.dtype("i1"),
    "F16": np.dtype("<f2"),
    "F32": np.dtype("<f4"),
}
_deserialize: Callable[[bytes], list[tuple[str, Mapping[str, Any]]]] = deserialize
REMEDY = "the pack is damaged or not one of ntc-viewer's; encode it again"


def expected_tensors(metadata: PackMetadata) -> dict[str, TensorShape]:
    """Return the type and shape of every tensor that a file with `metadata` must hold, and no others."""
    codec, expected = codec_of(metadata.codec), dict[str, TensorShape]()
    for index, texture in enumerate(metadata.textures):
        expected |= _numbered(codec.texture_shapes(metadata.codec, texture.width, texture.height), index)
    decoder = codec.decoder_shapes(metadata.codec)
    # A file holds no decoder where the one that ships with the program serves all textures.
    for index in range(codec.stored_decoders(metadata.grouping.name, metadata.decoders, metadata.codec)):
        expected |= _numbered(decoder, index)
    return expected


def _numbered(parts: Mapping[str, T], index: int) -> dict[str, T]:
    """Return `parts` by the names that texture or decoder `index` has in a file."""
    return {name.format(index): part for name, part in parts.items()}


def pack_tensors(pack: Pack) -> dict[str, NDArray[Any]]:
    """Return the tensors of the file of `pack`, by name."""
    codec, tensors = codec_of(pack.config), dict[str, NDArray[Any]]()
    for index, texture in enumerate(pack.textures):
        tensors |= _numbered(codec.texture_tensors(texture, pack.config), index)
    stored = codec.stored_decoders(pack.grouping.name, len(pack.decoders), pack.config)
    for index, decoder in enumerate(pack.decoders[:stored]):
        tensors |= _numbered(codec.decoder_tensors(decoder, pack.config), index)
    return tensors


def pack_bytes(pack: Pack) -> bytes:
    """Return the file of `pack`: the same pack always gives the same bytes."""
    return bytes(save(pack_tensors(pack), metadata={METADATA_KEY: metadata_json(pack)}))


def write_pack(path: Path, pack: Pack) -> None:
    """Write `pack` to `path` atomically. Raises InputError where it cannot be written."""
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
            size in (None, own) for own, size in zip(part["shape"], shape, strict=True)
        )
        if part["dtype"] != kind or not fits:
            found = f"{part['dtype']} {part['shape']}"
            wanted = ", ".join("any" if size is None else str(size) for size in shape)
            raise InputError(f"{path}: tensor {name} is {found}, expected {kind} [{wanted}]; {REMEDY}")


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
        found = {name: _tensor(file, name.format(index), path) for name in names}
        try:
            return read(found)
        except ValueError as error:
            raise InputError(f"{path}: tensor {str(error).replace('{}', str(index))}; {REMEDY}") from error

    def texture(index: int, own: TextureMetadata, group: int) -> EncodedTexture:
        known = {**msgspec.structs.asdict(own), "group": group}
        names = codec.texture_shapes(config, own.width, own.height)
        return part(names, index, lambda tensors: codec.read_texture(tensors, known, config))

    members = enumerate(zip(metadata.textures, metadata.grouping.groups, strict=True))
    textures = tuple(texture(index, own, group) for index, (own, group) in members)
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
    """Return the pack of tensors `file` (by name: "dtype", "shape", "data") and `metadata`, read from `path`.

    Raises InputError where they are not those that the metadata stand for, or hold what no pack may.
    """
    _check_header(file, metadata, path)
    return _read(file, metadata, path)


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Raise InputError, with one line that names the file, for every error of reading a pack."""
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
    """Read and check a pack: types, shapes, indices and finiteness. Raises InputError with one line.

    safetensors compares shapes with the file's length; what memory is taken is in proportion to that.
    """
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
"""Bytes of a header, as safetensors allows."""
_INDEXED = re.compile(r"(latents|adapter|decoder)\.(0|[1-9][0-9]{0,8})(\..+)?")
_Natural = Annotated[int, Meta(ge=0)]


class _Place(msgspec.Struct, frozen=True):
    """One tensor as the header of the file describes it."""

    dtype: str
    shape: list[_Natural]
    data_offsets: tuple[_Natural, _Natural]

    @property
    def fits(self) -> bool:
        """True if the tensor has as many bytes as its shape takes."""
        begin, end = self.data_offsets
        return self.dtype in NUMPY_TYPES and end - begin == math.prod(self.shape) * NUMPY_TYPES[self.dtype].itemsize


def _header(file: BinaryIO, path: Path) -> tuple[dict[str, _Place], PackMetadata, int]:
    """Return (tensors by name, metadata, where their bytes begin). Raises InputError, MetadataError."""
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
        # One after the other: tensors that share bytes would take more memory than the file.
        if place.data_offsets[0] != end or not place.fits:
            raise InputError(f"{path}: tensor {name!r} does not fit its shape or its place; {REMEDY}")
        end = place.data_offsets[1]
    if begin + end != size:
        raise InputError(f"{path}: has {size} bytes, its header names {begin + end}; {REMEDY}")
    return tensors, parse_metadata(text), begin


def pack_contents(file: BinaryIO, path: Path) -> tuple[PackMetadata, list[int]]:
    """Return (metadata, bytes of each texture's latents) of the open pack `file` from its header alone; `path` is for errors.

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
    """Return (metadata of the wanted textures alone, and by kind of tensor the new number of each that is kept)."""
    textures = [index for index, each in enumerate(metadata.textures) if each.pixel_hash in wanted]
    used = {metadata.grouping.groups[index] for index in textures}
    # Of decoders that ship with the program there must be one, whichever textures are there.
    stored = codec_of(metadata.codec).stored_decoders(metadata.grouping.name, metadata.decoders, metadata.codec)
    kept = sorted(used) if stored else range(metadata.decoders)
    new_groups = {group: number for number, group in enumerate(kept)}
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
    """Return the pack at `path` with those of its textures alone whose pixel hash is `wanted`, and the decoders that they use.

    What is read is checked as `read_pack` checks it. Raises InputError with one line; also where no texture is wanted.
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
