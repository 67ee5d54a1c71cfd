"""Reading some textures of a `.ntc` file: of what the file holds, only the header and their tensors are read."""

import json
import math
import os
import re
from collections.abc import Container, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, BinaryIO

import msgspec
from msgspec import Meta

from ntc.codec.config import UNIVERSAL
from ntc.codec.model import Pack
from ntc.errors import InputError, MetadataError
from ntc.io import LENGTH_BYTES
from ntc.pack.file import NUMPY_TYPES, REMEDY, checked_pack
from ntc.pack.schema import METADATA_KEY, PackMetadata, parse_metadata

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
        """Whether its bytes are as many as its shape takes."""
        begin, end = self.data_offsets
        return self.dtype in NUMPY_TYPES and end - begin == math.prod(self.shape) * NUMPY_TYPES[self.dtype].itemsize


def _header(file: BinaryIO, path: Path) -> tuple[dict[str, _Place], PackMetadata, int]:
    """(tensors by name, metadata, where their bytes begin). Raises InputError, MetadataError."""
    size = os.fstat(file.fileno()).st_size
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
        raise InputError(f"{path}: has {size} bytes where its header names {begin + end}; {REMEDY}")
    return tensors, parse_metadata(text), begin


def _chosen(metadata: PackMetadata, wanted: Container[str]) -> tuple[PackMetadata, dict[str, dict[int, int]]]:
    """(metadata of the wanted textures alone, and by kind of tensor the new number of each that is kept)."""
    textures = [index for index, each in enumerate(metadata.textures) if each.pixel_hash in wanted]
    used = {metadata.grouping.groups[index] for index in textures}
    # Of decoders that ship with the program there must be one, whichever textures are there.
    kept = range(metadata.decoders) if metadata.grouping.name == UNIVERSAL else sorted(used)
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
    """The pack at `path` with those of its textures alone whose pixel hash is `wanted`, and the decoders that they use.

    What is read is checked as `read_pack` checks it. Raises InputError with one line; also where no texture is wanted.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            places, metadata, begin = _header(file, path)
            fewer, numbers = _chosen(metadata, wanted)
            if not fewer.textures:
                raise InputError(f"{path}: holds none of the textures that are asked for")
            tensors: dict[str, Mapping[str, Any]] = {}
            for name, place in places.items():
                parts = _INDEXED.fullmatch(name)
                number = numbers[parts[1]].get(int(parts[2])) if parts else None
                if parts is None or number is None:
                    continue
                file.seek(begin + place.data_offsets[0])
                data = file.read(place.data_offsets[1] - place.data_offsets[0])
                tensors[f"{parts[1]}.{number}{parts[3] or ''}"] = {
                    "dtype": place.dtype,
                    "shape": place.shape,
                    "data": data,
                }
            return checked_pack(tensors, fewer, path)
    except MetadataError as error:
        raise InputError(f"{path}: {error}; {REMEDY}") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); check the path") from error
    except MemoryError as error:
        raise InputError(f"{path}: takes more memory than there is; encode at a smaller --texture-size") from error
