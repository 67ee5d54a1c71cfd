"""The decoder that ships with the program: tables of codec `block` that were fitted once, to textures of no scene in particular.

What it was fitted to, and how it is made anew: assets/README.md.
"""

from dataclasses import fields
from functools import lru_cache
from pathlib import Path

import numpy as np
from safetensors.numpy import load_file

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.model import BlockDecoder
from ntc.codec.config import UNIVERSAL
from ntc.errors import InputError

VERSION = 2
"""Of the tables. Packs name theirs: tables that packs were written for are never changed, only others added."""
UNIVERSAL_CONFIG = BlockConfig(coefficients=192, modes=64)
"""What the tables were fitted with. They serve every size of codes, for bits of coefficients follow from scales."""


def tables_path(version: int, channels: int) -> Path:
    """Where the tables for textures of up to `channels` channels lie."""
    return Path(__file__).with_name(f"universal_{version}_{channels}.safetensors")


@lru_cache(maxsize=2)
def universal_decoder(channels: int, version: int = VERSION) -> BlockDecoder:
    """The shipped tables for packs of `channels` output channels. Raises InputError for tables that this program does not have."""
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
    """What the file of `tables_path` holds."""
    return {field.name: getattr(decoder, field.name) for field in fields(decoder)}
