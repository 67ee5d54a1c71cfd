"""Test cases for numerical stability of codec `block`: codes, tables and coordinates from ordinary to hostile."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lab.bench.random_pack import random_block_pack
from lab.bench.stability_cases import SIZES, StabilityCase, anywhere, place_cases
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.model import BlockDecoder, block_parts
from ntc.codec.block.storage import LARGEST_NUMBER
from ntc.codec.block.tensors import LARGEST_BASIS_SCALE
from ntc.codec.model import Pack
from ntc.pack.schema import LARGEST_SIDE

Words = NDArray[np.uint32]
SIZED = BlockConfig(coefficients=60, modes=8)
SINGLE_SIZE = replace(SIZED, block_words=(3,), mean_words=3.0)
SMALL_BLOCKS = replace(SIZED, block_side=4, block_words=(1, 2), mean_words=1.5, coefficients=40)
LARGEST = BlockConfig(block_words=(15, 16), mean_words=16.0, coefficients=192, modes=64)


def _with_codes(pack: Pack, fill: Callable[[Words], Words]) -> Pack:
    """Return `pack` with other codes. Its codes have one size, so that it has no directories to change."""
    return replace(pack, textures=tuple(replace(t, words=fill(t.words)) for t in block_parts(pack).textures))


def _with_tables(pack: Pack, change: Callable[[BlockDecoder], BlockDecoder]) -> Pack:
    return replace(pack, decoders=tuple(change(decoder) for decoder in block_parts(pack).decoders))


def _largest_numbers(pack: Pack) -> Pack:
    """Return `pack` with every number at the limit of the file format."""
    largest = np.float32(LARGEST_NUMBER)
    tables = _with_tables(
        pack,
        lambda one: replace(
            one,
            basis_scale=np.full_like(one.basis_scale, LARGEST_BASIS_SCALE),
            scales=np.full_like(one.scales, 255),
        ),
    )
    textures = (replace(t, axes=np.sign(t.axes) * largest) for t in block_parts(tables).textures)
    return replace(tables, textures=tuple(textures))


def block_cases(texels: int, seed: int = 0) -> list[StabilityCase]:
    """Return all cases of codec `block`, with about `texels` texels each."""
    random = np.random.default_rng(seed)
    plain = random_block_pack(SIZES, (0, 1), SINGLE_SIZE)
    sized = random_block_pack(SIZES, (0, 1), SIZED)
    tall = ((1, 1), (1, LARGEST_SIDE), (LARGEST_SIDE, 1), (1000, 3))
    packs = {
        "codes of one size": plain,
        "codes of four sizes": sized,
        "largest codes and tables": random_block_pack(SIZES, (0, 1), LARGEST),
        "blocks of 4x4": random_block_pack(SIZES, (0, 1), SMALL_BLOCKS),
        "codes 0": _with_codes(plain, np.zeros_like),
        "codes of ones": _with_codes(plain, lambda words: np.full_like(words, 0xFFFFFFFF)),
        "basis 0": _with_tables(plain, lambda one: replace(one, basis=np.zeros_like(one.basis))),
        "scales at the least": _with_tables(plain, lambda one: replace(one, scales=np.zeros_like(one.scales))),
        "numbers as large as files may hold": _largest_numbers(plain),
        "1x1, 1x32768, 32768x1, 1000x3": random_block_pack(tall, (0, 1, 0, 1), SIZED),
    }
    cases = [StabilityCase(f"block: {name}", pack, anywhere(pack, texels, random)) for name, pack in packs.items()]
    strip = random_block_pack(((LARGEST_SIDE, 2),), (0,), SIZED)
    return [*cases, *(replace(case, name=f"block: {case.name}") for case in place_cases(sized, strip, texels, random))]
