"""Files of other programs with the suffix .ntc, recognised by their first bytes.

NVIDIA's texture sets (magic NTEX) are a header, a JSON chunk and a data chunk (TextureSetFile.md of RTXNTC, container version 0x100).
Their description is read here, but they are not decoded: the format's public text does not define how latents, positions and weights
give values, and the licence of NVIDIA's library does not allow to follow its code. three-ntc writes JSON.
"""

import os
import stat
import struct
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from ntc.errors import InputError

NTEX_MAGIC = b"NTEX"
NTEX_VERSION = 0x100
_NTEX_HEADER = struct.Struct("<4sIQQQQ")
LARGEST_JSON = 1 << 24
"""Largest JSON chunk in bytes that is read; those of real files have a few thousand."""
LONGEST_NAME = 200
MOST_ENTRIES = 4096
OtherFormat = Literal["ntex", "json"]

_Side = Annotated[int, Meta(ge=1, le=1 << 20)]
_Count = Annotated[int, Meta(ge=0, le=1 << 16)]
_Name = Annotated[str, Meta(max_length=4096)]
_Bytes = Annotated[int, Meta(ge=0, le=(1 << 63) - 1)]


class NtexTexture(msgspec.Struct, frozen=True, rename="camel"):
    """A texture of a texture set: a range of its channels."""

    name: _Name
    first_channel: _Count
    num_channels: Annotated[int, Meta(ge=1, le=4)]
    channel_format: _Name = "UNORM8"
    rgb_color_space: _Name = "Linear"
    bc_format: _Name = "None"


class _Layer(msgspec.Struct, frozen=True, rename="camel"):
    input_channels: _Count
    output_channels: _Count


class _Network(msgspec.Struct, frozen=True, rename="camel"):
    layers: Annotated[list[_Layer], Meta(max_length=64)]
    weight_type: _Name = ""


class _LatentImage(msgspec.Struct, frozen=True, rename="camel"):
    high_res_width: _Side
    high_res_height: _Side
    low_res_width: _Side
    low_res_height: _Side


class _View(msgspec.Struct, frozen=True, rename="camel"):
    offset: _Bytes
    stored_size: _Bytes


class _Description(msgspec.Struct, frozen=True, rename="camel"):
    schema_version: int
    width: _Side
    height: _Side
    num_channels: Annotated[int, Meta(ge=1, le=64)]
    num_color_mips: Annotated[int, Meta(ge=1, le=32)] = 1
    textures: Annotated[list[NtexTexture], Meta(max_length=MOST_ENTRIES)] = []
    latents: Annotated[list[_LatentImage], Meta(max_length=MOST_ENTRIES)] = []
    mlp: _Network | None = None
    mlp_versions: Annotated[list[_Network], Meta(max_length=64)] = []
    views: Annotated[list[_View], Meta(max_length=1 << 16)] = []


class NtexFile(msgspec.Struct, frozen=True):
    """Facts about one of NVIDIA's texture sets, as `info` prints them."""

    file: str
    width: int
    height: int
    mips: int
    channels: int
    textures: tuple[NtexTexture, ...]
    networks: tuple[str, ...]
    """E.g. "Int8: 48-32-16"."""
    latent_sizes: tuple[tuple[int, int], ...]
    """(width, height) in texels of the larger grid of each latent level."""
    data_bytes: int

    @property
    def bits_per_texel(self) -> float:
        """Bits of the data chunk per texel of mip 0."""
        return self.data_bytes * 8.0 / (self.width * self.height)

    def lines(self) -> list[str]:
        """Return the lines that `info` prints."""
        named = [
            f"  {_printable(texture.name)}: channels {texture.first_channel} to "
            f"{texture.first_channel + texture.num_channels - 1}, {_printable(texture.channel_format)}, "
            f"{_printable(texture.rgb_color_space)}"
            for texture in self.textures
        ]
        grids = ", ".join(f"{width}x{height}" for width, height in self.latent_sizes)
        return [
            f"{self.file}: a texture set of NVIDIA's RTX Neural Texture Compression (NTEX), not a pack of ntc-viewer",
            f"{self.width} x {self.height} texels, {self.mips} mips, {self.channels} channels, "
            f"{self.data_bytes} bytes ({self.bits_per_texel:.2f} bits a texel)",
            f"latents: {grids or 'none'}",
            *(f"network {_printable(network)}" for network in self.networks),
            f"textures: {len(self.textures)}",
            *named,
            f"not decoded: {WHY_NOT_DECODED}",
        ]

    def json(self) -> dict[str, Any]:
        """Return what `info F.ntc --json` prints."""
        return {"format": "NTEX", **msgspec.to_builtins(self), "bits_per_texel": self.bits_per_texel}


WHY_NOT_DECODED = "the public description of the format does not say how latents and weights give texels"
NTEX_REMEDY = (
    "ntc-viewer info shows what it holds; decode it with NVIDIA's tools, and encode the images with ntc-viewer encode"
)


def _printable(text: str) -> str:
    return "".join(letter for letter in " ".join(text.split()) if letter.isprintable())[:LONGEST_NAME]


def other_format(beginning: bytes) -> OtherFormat | None:
    """Return the format of a file of another program, by its first 16 bytes; None for packs and all other files."""
    if beginning.startswith(NTEX_MAGIC):
        return "ntex"
    # A safetensors file begins with a length: this one would have 10^18 bytes of header.
    return "json" if beginning.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{") else None


def refuse_other_formats(path: Path, beginning: bytes) -> None:
    """Raise InputError if the file at `path` is another program's; the message says which."""
    format_name = other_format(beginning)
    if format_name == "ntex":
        raise InputError(f"{path}: is a texture set of NVIDIA's (NTEX), not a pack of ntc-viewer; {NTEX_REMEDY}")
    if format_name == "json":
        raise InputError(
            f"{path}: is JSON, as three-ntc writes to .ntc files, not a pack of ntc-viewer; encode the images it was "
            "made of with ntc-viewer encode"
        )


def beginning_of(path: Path) -> bytes:
    """Return the first 16 bytes of the regular file at `path`; empty if it cannot be read. The reader then reports why."""
    try:
        with path.open("rb") as file:
            return file.read(16) if stat.S_ISREG(os.fstat(file.fileno()).st_mode) else b""
    except OSError:
        return b""


def read_ntex(path: Path) -> NtexFile:
    """Return facts about the texture set at `path`. Raises InputError if it is damaged or of another version."""
    remedy = "copy or make it again"
    try:
        with path.open("rb") as file:
            whole = os.fstat(file.fileno()).st_size
            header = file.read(_NTEX_HEADER.size)
            if len(header) < _NTEX_HEADER.size or not header.startswith(NTEX_MAGIC):
                raise InputError(f"{path}: truncated header of NVIDIA's texture set (NTEX); {remedy}")
            _, version, offset, size, data_offset, data_size = _NTEX_HEADER.unpack(header)
            if version != NTEX_VERSION:
                problem = f"container version {version:#x} of NVIDIA's texture set (NTEX)"
                raise InputError(f"{path}: {problem}; {NTEX_VERSION:#x} is read: {remedy} with a newer version")
            for name, start, length in (("JSON", offset, size), ("data", data_offset, data_size)):
                if start + length > whole:
                    raise InputError(f"{path}: its {name} chunk ends beyond the file's {whole} bytes; {remedy}")
            if size > LARGEST_JSON:
                raise InputError(f"{path}: {size} bytes of JSON, at most {LARGEST_JSON} are read; {remedy}")
            file.seek(offset)
            text = file.read(size).rstrip(b"\0")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    try:
        description = msgspec.json.decode(text, type=_Description)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{path}: its JSON chunk is not that of a texture set ({error}); {remedy}") from error
    if description.schema_version != 1:
        raise InputError(
            f"{path}: schemaVersion {description.schema_version} of NVIDIA's texture set; 1 is read: {remedy}"
        )
    if any(view.offset + view.stored_size > data_size for view in description.views):
        raise InputError(f"{path}: a view ends beyond the {data_size} bytes of its data chunk; {remedy}")
    if any(texture.first_channel + texture.num_channels > description.num_channels for texture in description.textures):
        raise InputError(f"{path}: a texture has channels beyond the set's {description.num_channels}; {remedy}")
    networks = ([description.mlp] if description.mlp is not None else []) + description.mlp_versions
    return NtexFile(
        str(path),
        description.width,
        description.height,
        description.num_color_mips,
        description.num_channels,
        tuple(description.textures),
        tuple(_network(network) for network in networks),
        tuple((latent.high_res_width, latent.high_res_height) for latent in description.latents),
        data_size,
    )


def _network(network: _Network) -> str:
    inputs = [layer.input_channels for layer in network.layers[:1]]
    sizes = "-".join(map(str, [*inputs, *(layer.output_channels for layer in network.layers)]))
    return f"{network.weight_type or 'of unknown type'}: {sizes}"
