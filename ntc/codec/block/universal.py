"""The decoder that ships with the program: tables of codec `block`, fitted to textures of many scenes.

assets/README.md lists these textures and the command that fits the tables.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load_file

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.model import BlockDecoder
from ntc.codec.config import UNIVERSAL
from ntc.codec.maps import MAP_CHANNELS, MAPS, MapName, channel_places, map_slices, plane_channels
from ntc.errors import InputError

VERSION = 2
"""Version of the tables, which packs name. Shipped tables are never changed; a new version is added."""
UNIVERSAL_CONFIG = BlockConfig(coefficients=192, modes=64)
"""Settings that the tables were fitted with. They serve every size of codes: bits of coefficients follow from scales."""


def tables_path(version: int, channels: int) -> Path:
    """Return the file of the tables for textures of up to `channels` channels."""
    return Path(__file__).with_name(f"universal_{version}_{channels}.safetensors")


@lru_cache(maxsize=2)
def universal_decoder(channels: int, version: int = VERSION) -> BlockDecoder:
    """Return the shipped tables for packs of `channels` output channels. Raises InputError for tables that this program does not
    have."""
    path = tables_path(version, channels)
    if not path.is_file():
        raise InputError(
            f"grouping {UNIVERSAL}: this program has no tables of version {version} for {channels} channels; "
            "install a newer one, or encode again"
        )
    tensors = load_file(path)
    for array in tensors.values():
        array.setflags(write=False)
    return BlockDecoder(**tensors)


def universal_tensors(decoder: BlockDecoder) -> dict[str, np.ndarray]:
    """Return the tensors of the file of `tables_path`."""
    return {field.name: getattr(decoder, field.name) for field in fields(decoder) if field.name != "gains"}


SET_VERSION = 1
"""Version of the tables for whole materials, which packs name."""
SET_MODES = 128
SET_CHANNELS = 12
"""Channels of the tables: those of MAPS, with a base of four channels."""
BANDS = 5
"""Bands of a channel: coefficients of about equal strength, the strongest first."""
FINE_BLOCKS = 3000
"""A group with a texture of so many blocks, all levels counted, has a gain for each coefficient; else one for each band. 512x512
texels have more."""
MOST_SCALED_GROUPS = 16
"""Most groups with separate gains in grouping `universal`: a renderer keeps scaled tables for each."""


@dataclass(frozen=True, eq=False)
class SetTables:
    """Tables for whole materials, before a group's gains."""

    decoder: BlockDecoder
    """Tables at gains of 0."""
    bands: NDArray[np.int64]
    """[coefficients] band of each coefficient: BANDS for each channel."""
    energies: NDArray[np.float32]
    """[bands] energy of a band, in blocks of normalised values, whose coefficients have a gain of 0. For the encoder alone."""


def set_tables_path(version: int) -> Path:
    """Return the file of the tables for all maps."""
    return Path(__file__).with_name(f"universal_sets_{version}.safetensors")


@lru_cache(maxsize=16)
def set_tables(maps: Sequence[MapName], channels: int, version: int | None = SET_VERSION) -> SetTables:
    """Return the shipped tables for material sets of `maps` with `channels` channels: the rows of these channels. Raises InputError
    for tables that this program does not have."""
    path = set_tables_path(version or 0)
    if not path.is_file():
        raise InputError(
            f"grouping {UNIVERSAL}: this program has no tables of version {version} for whole materials; "
            "install a newer one, or encode again"
        )
    tensors = load_file(path)
    places = list(_places(maps, channels))
    number = np.full(SET_CHANNELS, -1)
    number[places] = np.arange(channels)
    selected = np.nonzero(number[tensors["channels"]] >= 0)[0]
    if "alpha" in maps:
        # Rows of a plane lie together, and coverage is the last one.
        selected = selected[np.argsort(number[tensors["channels"][selected]] == channels - 1, kind="stable")]
    known = [*plane_channels(MAPS, SET_CHANNELS), "coverage"]
    edges = np.column_stack([tensors["edges"], np.arange(len(tensors["edges"])) & 1])
    planes = [known.index(plane) for plane in plane_channels(maps, channels)]
    rows = {name: tensors[name][selected] for name in ("basis", "channels", "basis_scale", "bands")}
    decoder = BlockDecoder(
        rows["basis"],
        number[rows["channels"]].astype(np.uint8),
        rows["basis_scale"],
        np.ascontiguousarray(tensors["scales"][:, selected]),
        np.ascontiguousarray(edges[:, planes].astype(np.uint8)),
    )
    bands = number[rows["channels"]] * BANDS + rows["bands"]
    return SetTables(decoder, bands, tensors["energies"].reshape(SET_CHANNELS, BANDS)[places].reshape(-1))


def _places(maps: Sequence[MapName], channels: int) -> tuple[int, ...]:
    """Return the channel of the tables whose rows each channel takes: of the map `alpha` the base's fourth.

    Raises InputError for a base of four channels beside that map.
    """
    if "alpha" not in maps:
        return channel_places(maps, channels, MAPS, SET_CHANNELS)
    fourth = MAP_CHANNELS["base"]
    if "base" in maps and map_slices(maps, channels)["base"].stop > fourth:
        raise InputError(
            f"grouping {UNIVERSAL}: no tables for a base of four channels beside the map alpha; leave one out"
        )
    others = tuple(name for name in maps if name != "alpha")
    return (*(channel_places(others, channels - 1, MAPS, SET_CHANNELS) if others else ()), fourth)


def set_config(maps: Sequence[MapName], channels: int) -> BlockConfig:
    """Settings of the shipped tables for material sets of `maps` with `channels` channels."""
    rows = len(set_tables(tuple(maps), channels).bands)
    plain = replace(UNIVERSAL_CONFIG, coefficients=1, modes=SET_MODES, maps=tuple(maps), output_channels=channels)
    return replace(plain, coefficients=rows, tables=SET_VERSION)


def scaled_decoder(tables: SetTables, gains: NDArray[np.int8]) -> BlockDecoder:
    """Return the decoder of a group with gains [coefficients] or [bands], in steps of 1/16 octave."""
    each = gains if len(gains) == len(tables.bands) else gains[tables.bands]
    scales = tables.decoder.scales.astype(np.int64) + each.astype(np.int64)
    return replace(tables.decoder, scales=np.clip(scales, 0, 255).astype(np.uint8), gains=gains)
