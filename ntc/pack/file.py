"""Reading and writing `.ntc` files: safetensors with JSON metadata (docs/pack-format.md).

Files are read whole (`ntc.io.read_file`), not mapped: a mapped file that another process shortens would end this one.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, deserialize
from safetensors.numpy import save

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.config import CodecConfig
from ntc.codec.latents import latent_cell_count
from ntc.codec.model import Adapter, AnyDecoder, Decoder, EncodedTexture, Grouping, Pack
from ntc.codec.quantize import packed_cells, unpacked_cells
from ntc.errors import InputError, MetadataError
from ntc.io import read_file, write_bytes
from ntc.pack.block_tensors import TensorShape, block_tensors, expected_block_tensors, read_block_parts, stored_decoders
from ntc.pack.other_formats import beginning_of, refuse_other_formats
from ntc.pack.schema import METADATA_KEY, PackMetadata, metadata_json, parse_metadata

HIDDEN_LAYERS = 2
_Tensors = Mapping[str, Mapping[str, Any]]
"""By name: "dtype", "shape" and "data", checked by safetensors against each other and the file's length."""
NUMPY_TYPES: dict[str, np.dtype[Any]] = {
    "U8": np.dtype("u1"),
    "I8": np.dtype("i1"),
    "F16": np.dtype("<f2"),
    "F32": np.dtype("<f4"),
}
LENGTH_BYTES = 8
"""A safetensors file begins with the length of its JSON header."""
_deserialize: Callable[[bytes], list[tuple[str, Mapping[str, Any]]]] = deserialize
REMEDY = "the pack is damaged or not one of ntc-viewer's; encode it again"


def _texture_tensors(index: int, cells: int, config: CodecConfig) -> dict[str, TensorShape]:
    channels = config.latent_channels
    tensors: dict[str, TensorShape] = {
        f"latents.{index}": ("U8", (cells, config.cell_bytes)),
        f"latents.{index}.scale": ("F32", (channels,)),
        f"latents.{index}.offset": ("F32", (channels,)),
    }
    if config.adapters:
        tensors[f"adapter.{index}.scales"] = ("F16", (HIDDEN_LAYERS, config.hidden_width))
        tensors[f"adapter.{index}.biases"] = ("F16", (HIDDEN_LAYERS, config.hidden_width))
    if config.adapter_output:
        tensors[f"adapter.{index}.output.weight"] = ("F16", (config.output_channels, config.hidden_width))
        tensors[f"adapter.{index}.output.bias"] = ("F16", (config.output_channels,))
    return tensors


def _decoder_tensors(index: int, config: CodecConfig) -> Iterator[tuple[str, tuple[str, tuple[int, ...]]]]:
    for layer, (outputs, inputs) in enumerate(config.layer_shapes):
        kind = f"F{config.weight_bits}"
        yield f"decoder.{index}.{layer}.weight", (kind, (outputs, inputs))
        yield f"decoder.{index}.{layer}.bias", (kind, (outputs,))


def expected_tensors(metadata: PackMetadata) -> dict[str, TensorShape]:
    """Type and shape of every tensor that a file with `metadata` must hold, and no others."""
    if isinstance(metadata.codec, BlockCodecConfig):
        return expected_block_tensors(len(metadata.textures), stored_decoders(metadata), metadata.codec)
    expected: dict[str, TensorShape] = {}
    for index, texture in enumerate(metadata.textures):
        cells = latent_cell_count(texture.width, texture.height, metadata.codec)
        expected.update(_texture_tensors(index, cells, metadata.codec))
    for index in range(metadata.decoders):
        expected.update(_decoder_tensors(index, metadata.codec))
    return expected


def pack_bytes(pack: Pack) -> bytes:
    """The file of `pack`: the same pack always gives the same bytes."""
    tensors = block_tensors(pack) if isinstance(pack.config, BlockCodecConfig) else _grid_tensors(pack)
    return bytes(save(tensors, metadata={METADATA_KEY: metadata_json(pack)}))


def write_pack(path: Path, pack: Pack) -> None:
    """Write `pack` to `path` atomically. Raises InputError where it cannot be written."""
    write_bytes(path, pack_bytes(pack))


def _grid_tensors(pack: Pack) -> dict[str, NDArray[Any]]:
    tensors: dict[str, NDArray[Any]] = {}
    for index, texture in enumerate(pack.textures):
        tensors[f"latents.{index}"] = packed_cells(texture.latents, pack.grid_config.latent_bits)
        tensors[f"latents.{index}.scale"] = np.ascontiguousarray(texture.scale)
        tensors[f"latents.{index}.offset"] = np.ascontiguousarray(texture.offset)
        if texture.adapter is not None:
            tensors[f"adapter.{index}.scales"] = texture.adapter.scales.astype(np.float16)
            tensors[f"adapter.{index}.biases"] = texture.adapter.biases.astype(np.float16)
            if texture.adapter.output_weight is not None and texture.adapter.output_bias is not None:
                tensors[f"adapter.{index}.output.weight"] = texture.adapter.output_weight.astype(np.float16)
                tensors[f"adapter.{index}.output.bias"] = texture.adapter.output_bias.astype(np.float16)
    kind = np.float16 if pack.grid_config.weight_bits == 16 else np.float32
    for index, decoder in enumerate(pack.grid_decoders):
        for layer, (weight, bias) in enumerate(zip(decoder.weights, decoder.biases, strict=True)):
            tensors[f"decoder.{index}.{layer}.weight"] = np.ascontiguousarray(weight, kind)
            tensors[f"decoder.{index}.{layer}.bias"] = np.ascontiguousarray(bias, kind)
    return tensors


def file_metadata(data: bytes) -> Mapping[str, Any]:
    """The string metadata of a safetensors file that safetensors has accepted; empty where it has none."""
    length = int.from_bytes(data[:LENGTH_BYTES], "little")
    header = json.loads(data[LENGTH_BYTES : LENGTH_BYTES + length])
    return header.get("__metadata__") or {}


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


def _adapter(file: _Tensors, index: int, config: CodecConfig, path: Path) -> Adapter | None:
    if not config.adapters:
        return None
    parts = ("scales", "biases", "output.weight", "output.bias") if config.adapter_output else ("scales", "biases")
    return Adapter(*(_tensor(file, f"adapter.{index}.{part}", path).astype(np.float32) for part in parts))


def _grid_textures(
    file: _Tensors, metadata: PackMetadata, config: CodecConfig, path: Path
) -> tuple[EncodedTexture, ...]:
    return tuple(
        EncodedTexture(
            **msgspec.structs.asdict(texture),
            group=group,
            latents=unpacked_cells(_tensor(file, f"latents.{index}", path), config.latent_bits),
            scale=_tensor(file, f"latents.{index}.scale", path),
            offset=_tensor(file, f"latents.{index}.offset", path),
            adapter=_adapter(file, index, config, path),
        )
        for index, (texture, group) in enumerate(zip(metadata.textures, metadata.grouping.groups, strict=True))
    )


def _grid_decoder(file: _Tensors, index: int, config: CodecConfig, path: Path) -> Decoder:
    def parts(part: str) -> tuple[NDArray[np.float32], ...]:
        names = [f"decoder.{index}.{layer}.{part}" for layer in range(len(config.layer_shapes))]
        return tuple(_tensor(file, name, path).astype(np.float32) for name in names)

    return Decoder(weights=parts("weight"), biases=parts("bias"))


def _read(file: _Tensors, metadata: PackMetadata, path: Path) -> Pack:
    config = metadata.codec
    decoders: tuple[AnyDecoder, ...]
    if isinstance(config, CodecConfig):
        textures = _grid_textures(file, metadata, config, path)
        decoders = tuple(_grid_decoder(file, index, config, path) for index in range(metadata.decoders))
    else:
        try:
            textures, decoders = read_block_parts(lambda name: _tensor(file, name, path), metadata, config)
        except ValueError as error:
            raise InputError(f"{path}: tensor {error}; {REMEDY}") from error
    grouping = Grouping(**msgspec.structs.asdict(metadata.grouping))
    return Pack(config, grouping, textures, decoders, metadata.training, path)


def checked_pack(file: _Tensors, metadata: PackMetadata, path: Path) -> Pack:
    """The pack of tensors `file` (by name: "dtype", "shape", "data") and `metadata`, read from `path`.

    Raises InputError where they are not those that the metadata stand for, or hold what no pack may.
    """
    _check_header(file, metadata, path)
    return _read(file, metadata, path)


def read_pack(path: Path) -> Pack:
    """Read and check a pack: types, shapes, indices and finiteness. Raises InputError with one line.

    safetensors compares shapes with the file's length; what memory is taken is in proportion to that.
    """
    path = Path(path)
    try:
        if not path.is_file():
            raise InputError(f"{path}: {'is a folder' if path.is_dir() else 'no such file'}; name a .ntc pack")
        if path.stat().st_size == 0:
            raise InputError(f"{path}: the file is empty; {REMEDY}")
        refuse_other_formats(path, beginning_of(path))
        data = read_file(path)
        file = dict(_deserialize(data))
        text = file_metadata(data).get(METADATA_KEY)
        if text is None:
            raise InputError(f"{path}: has no {METADATA_KEY!r} metadata; {REMEDY}")
        return checked_pack(file, parse_metadata(text), path)
    except SafetensorError as error:
        raise InputError(f"{path}: not a safetensors file ({error}); {REMEDY}") from error
    except MetadataError as error:
        raise InputError(f"{path}: {error}; {REMEDY}") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); check the file's permissions") from error
    except MemoryError as error:
        raise InputError(f"{path}: takes more memory than there is; encode at a smaller --texture-size") from error
