"""The decoder that ships with the program: tables of codec `block` that were fitted once, to textures of no scene in particular.

What it was fitted to, and how it is made anew: assets/README.md.
"""

from functools import lru_cache
from pathlib import Path

from safetensors.numpy import load_file

from ntc.codec.block_1.model import BlockDecoder
from ntc.codec.config import UNIVERSAL
from ntc.errors import InputError

VERSION = 1
"""Of the tables. Packs name theirs: tables that packs were written for are never changed, only others added."""


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
    decoder = BlockDecoder(tensors["basis"], tensors["basis_scale"], tensors["scales"])
    for array in (decoder.basis, decoder.basis_scale, decoder.scales):
        array.setflags(write=False)
    return decoder
