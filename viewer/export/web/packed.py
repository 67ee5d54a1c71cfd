"""A pack as the page reads it: for each texture its records and latents, the decoders as rows of a picture, and shaders."""

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ntc.codec.gpu import SOFTWARE, WEIGHT_COLUMN_BITS, level_records
from ntc.codec.latents import texture_levels
from ntc.codec.maps import CODED_PLANES, PLANE_COMPONENTS, Plane, plane_channels
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from viewer.gl.older_glsl import GLSL_ES_300, older_source
from viewer.gl.program import ShaderLibrary
from viewer.locations import shaders_folder
from viewer.scene.map_pictures import NEUTRAL
from viewer.scene.model import SceneTexture

SHADER = "web/decode_mip.frag"


@dataclass(frozen=True)
class PackedTexture:
    """Texture as its three samplers of words hold it, little-endian."""

    record: bytes
    """`GpuTables.texture_record`; its finest mip has row 0 of `levels`."""
    levels: bytes
    """LEVEL_RECORDs, finest first; `first_cell` counts in `latents`."""
    latents: bytes


@dataclass(frozen=True)
class PackedDecoders:
    """Decoders that all textures share."""

    data: bytes
    """Rows of 2^WEIGHT_COLUMN_BITS blocks of four numbers, the last one padded with zeros."""
    is_integer: bool
    """True if the numbers are uint32 not float32."""
    loop_length: int
    """The shaders' uniform `network_blocks`."""

    @property
    def rows(self) -> int:
        """Rows of the picture."""
        return len(self.data) >> (WEIGHT_COLUMN_BITS + 4)


def packed_decoders(pack: Pack, chosen: Sequence[int]) -> PackedDecoders:
    """Return all decoders of `pack`, then the adapters of its textures `chosen`, in single precision."""
    tables = codec_of(pack.config).gpu_tables(pack.config)
    data = tables.all_data(pack, [pack.textures[index] for index in chosen])
    row = tables.block_bytes << WEIGHT_COLUMN_BITS
    return PackedDecoders(data.ljust(-(-len(data) // row) * row, b"\0"), tables.number_type == "u4", tables.loop_length)


def packed_textures(pack: Pack, chosen: Sequence[int]) -> Iterator[PackedTexture]:
    """Yield the textures `chosen` of `pack`, whose adapters lie as `packed_decoders` puts them."""
    tables = codec_of(pack.config).gpu_tables(pack.config)
    adapter = len(pack.decoders) * tables.decoder_blocks
    for index in chosen:
        texture = pack.textures[index]
        pyramid = texture_levels(texture, pack.config)
        record = np.zeros(1, tables.texture_record)
        tables.fill_record(record[0], texture, 0, adapter)
        levels = level_records(pyramid)
        levels["first_cell"] = [row.first for row in tables.level_rows(texture)]
        latents = tables.latent_words(texture, slice(None))
        yield PackedTexture(record.tobytes(), levels.tobytes(), latents.tobytes())
        adapter += tables.adapter_blocks


def decoding_shaders(pack: Pack) -> dict[Plane, str]:
    """GLSL ES 3.00 of the fragment shader that decodes a mip, for each plane that the codec of `pack` has."""
    config = pack.config
    tables = codec_of(config).gpu_tables(config)
    library = ShaderLibrary(shaders_folder(), tables.includes(SOFTWARE))
    found: dict[Plane, str] = {}
    for plane in plane_channels(config.maps, config.output_channels):
        defines = {"WEIGHTS_IN_IMAGE": 1, "PRECISION_FP16": 0, "PLANE": CODED_PLANES.index(plane)}
        if tables.filters_texels:
            # At the centre of a texel there is nothing to filter: that texel alone.
            defines["FILTER_STOCHASTIC"] = 1
        found[plane] = older_source(library.assemble(SHADER, defines).text, GLSL_ES_300).text
    return found


LARGEST_SIDE = 16383
"""Texels a side that WebP has at most."""


def plane_picture(texture: SceneTexture, plane: Plane) -> NDArray[np.uint8]:
    """Return [H, W, 3] uint8 of the plane `base`; of the others [2 H, W, 3]: the first three of its components, below them the
    fourth one.

    In one picture without alpha: browsers multiply by alpha what has one.
    """
    if plane == "base":
        return texture.pixels
    further, places = texture.further_maps, PLANE_COMPONENTS[plane]
    width, height = texture.size
    whole = np.full((height, width, 4), NEUTRAL, np.uint8)
    if plane == "surface":
        whole[..., :2] = 128  # without a normal map: along the surface's own
    for name, first in places.items():
        if name in further:
            whole[..., first : first + further[name].shape[2]] = further[name]
    return np.concatenate([whole[..., :3], np.repeat(whole[..., 3:], 3, axis=2)])


def webp(pixels: NDArray[np.uint8], name: str) -> bytes:
    """Return `pixels` [H, W, 3] or [H, W] as a lossless WebP. Raises InputError for one that is too large, by `name`."""
    if max(pixels.shape[:2]) > LARGEST_SIDE:
        raise InputError(
            f"{name}: {pixels.shape[1]} x {pixels.shape[0]} texels are more than WebP has; leave originals out"
        )
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).convert("RGB").save(file, "WEBP", lossless=True, quality=30, method=2)
    return file.getvalue()
