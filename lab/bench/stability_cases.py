"""Test cases for numerical stability: weights, latents, coordinates and sizes from ordinary to hostile."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from lab.bench.random_pack import random_pack
from ntc.codec.config import WrapMode
from ntc.codec.grid.model import Adapter, GridConfig, GridDecoder, grid_parts
from ntc.codec.latents import latent_levels, texture_levels
from ntc.codec.model import Pack
from ntc.pack.schema import LARGEST_SIDE as LARGEST_PACK_SIDE

Array = NDArray[np.float64]
Change = Callable[[NDArray[np.float32]], NDArray[np.floating]]
SIZES = ((64, 64), (17, 33))
LARGEST_SIDE = 16384
MANY_DECODERS = 2000
HOSTILE_NUMBERS = (np.nan, np.inf, -np.inf, 3.4e38, -3.4e38, 1e20, -1e9, 16777217.0, 1e-45, -1e-30, -0.0, 0.25)
BESIDE_AN_EDGE = (0.0, 1e-45, -1e-45, 1e-10, -1e-10, 3e-8, -3e-8, 1e-7, -1e-7, 1e-5, -1e-5)
SMALL_CODEC = GridConfig(hidden_width=16)
"""Codec of most cases: hostile inputs do not depend on the width, and wide networks that emulate halves compile slowly."""


@dataclass(frozen=True, eq=False)
class Requests:
    """Requests for texels of one texture. Numbers are float64, but exact in fp32."""

    texture: int
    uv: Array
    """[N, 2] texture coordinates."""
    lod: Array
    """[N] levels of detail."""


@dataclass(frozen=True, eq=False)
class StabilityCase:
    """Case of the study: a pack, and the texels to decode."""

    name: str
    pack: Pack
    requests: Sequence[Requests]
    rescale: bool = True
    """True where weights are rescaled for halves, as in the viewer."""


def as_single(values: NDArray[np.floating]) -> Array:
    """Return `values` rounded to fp32; those beyond its range become infinite."""
    with np.errstate(over="ignore"):
        return values.astype(np.float32).astype(np.float64)


def anywhere(pack: Pack, texels: int, random: np.random.Generator) -> list[Requests]:
    """Return requests for `texels` random texels, divided among the textures. Some uv and lod are a little out of range."""
    requests = []
    for index, texture in enumerate(pack.textures):
        count = max(1, texels // len(pack.textures))
        levels = len(texture_levels(texture, pack.config))
        uv, lod = random.uniform(-2.0, 2.0, (count, 2)), random.uniform(-0.5, levels - 0.5, count)
        requests.append(Requests(index, as_single(uv), as_single(lod)))
    return requests


def changed(pack: Pack, weights: Sequence[Change], biases: Sequence[Change]) -> Pack:
    """Return `pack` with changed weights and biases, by layer."""

    def of(decoder: GridDecoder) -> GridDecoder:
        with np.errstate(over="ignore", under="ignore"):
            return GridDecoder(
                tuple(change(part).astype(np.float32) for change, part in zip(weights, decoder.weights, strict=True)),
                tuple(change(part).astype(np.float32) for change, part in zip(biases, decoder.biases, strict=True)),
            )

    return replace(pack, decoders=tuple(of(decoder) for decoder in grid_parts(pack).decoders))


def scaled(pack: Pack, first: int, second: int, third: int) -> Pack:
    """Return `pack` with the weights of each layer times a power of two, and with biases scaled to match."""

    def times(exponent: int) -> Change:
        return lambda part: np.ldexp(part.astype(np.float64), exponent)

    weights = [times(first), times(second), times(third)]
    return changed(pack, weights, [times(first), times(first + second), times(first + second + third)])


def _largest_weights(part: NDArray[np.float32]) -> NDArray[np.floating]:
    return np.sign(part) * 3e38


def reordered(pack: Pack, seed: int = 0) -> Pack:
    """Return `pack` with hidden neurons in another order: the same function, but sums are computed in another order."""
    random = np.random.default_rng(seed)
    orders = [
        [random.permutation(grid_parts(pack).config.hidden_width) for _ in range(2)] for _ in grid_parts(pack).decoders
    ]

    def of(decoder: GridDecoder, first: NDArray[np.int64], second: NDArray[np.int64]) -> GridDecoder:
        a, b, c = decoder.weights
        weights = (a[first], b[np.ix_(second, first)], c[:, second])
        return GridDecoder(weights, (decoder.biases[0][first], decoder.biases[1][second], decoder.biases[2]))

    def adapted(adapter: Adapter | None, order: Sequence[NDArray[np.int64]]) -> Adapter | None:
        if adapter is None:
            return None
        rows = [
            np.stack([part[layer][order[layer]] for layer in range(2)]) for part in (adapter.scales, adapter.biases)
        ]
        output = None if adapter.output_weight is None else adapter.output_weight[:, order[1]]
        return Adapter(rows[0], rows[1], output, adapter.output_bias)

    return replace(
        pack,
        decoders=tuple(of(decoder, *order) for decoder, order in zip(grid_parts(pack).decoders, orders, strict=True)),
        textures=tuple(replace(t, adapter=adapted(t.adapter, orders[t.group])) for t in grid_parts(pack).textures),
    )


def _with_latents(pack: Pack, fill: Callable[[NDArray[np.uint8]], NDArray[np.uint8]]) -> Pack:
    return replace(pack, textures=tuple(replace(t, latents=fill(t.latents)) for t in grid_parts(pack).textures))


def wrapped_pack(pack: Pack) -> Pack:
    """Return a pack with the first texture of `pack` under every pair of wrap modes."""
    modes: tuple[WrapMode, ...] = get_args(WrapMode)
    pairs = list(product(modes, modes))
    first = pack.textures[0]
    textures = tuple(replace(first, pixel_hash=f"{index:032x}", wrap=pair) for index, pair in enumerate(pairs))
    return replace(pack, textures=textures, grouping=replace(pack.grouping, groups=(first.group,) * len(textures)))


def _at(pack: Pack, uv: Array, lod: Array) -> list[Requests]:
    return [Requests(index, as_single(uv), as_single(lod)) for index in range(len(pack.textures))]


def place_cases(pack: Pack, long: Pack, texels: int, random: np.random.Generator) -> list[StabilityCase]:
    """Return cases at hostile coordinates of `pack` and of `long`, a texture of the largest side: near edges, far away, NaN."""
    wrapped = wrapped_pack(pack)
    width, height = wrapped.textures[0].width, wrapped.textures[0].height
    count = max(16, texels // len(wrapped.textures))
    levels = len(latent_levels(width, height, pack.config))
    halves = random.integers(-4 * width, 4 * width + 1, (count, 2)) / 2.0
    far = random.uniform(-1e6, 1e6, (count, 2))
    beyond = np.concatenate(
        [random.uniform(-100.0, 0.0, count // 2), random.uniform(levels - 1, 100.0, count - count // 2)]
    )
    numbers = np.array(list(product(HOSTILE_NUMBERS, repeat=3)))
    strip = wrapped_pack(long)
    beside = random.integers(-2, 3, (count, 2)) + random.choice(BESIDE_AN_EDGE, (count, 2))
    uv = random.uniform(-2.0, 2.0, (count, 2))
    return [
        StabilityCase(
            "texel edges and centres, all wraps", wrapped, _at(wrapped, halves / (width, height), np.zeros(count))
        ),
        StabilityCase("beside the edges of 32768 texels, all wraps", strip, _at(strip, beside, np.zeros(count))),
        StabilityCase("uv up to 1e6", wrapped, _at(wrapped, far, random.uniform(0.0, levels - 1, count))),
        StabilityCase("lod below 0 and beyond the last", wrapped, _at(wrapped, uv, beyond)),
        StabilityCase("uv and lod NaN, Inf, 3.4e38, denormal", wrapped, _at(wrapped, numbers[:, :2], numbers[:, 2])),
    ]


def stability_cases(texels: int, seed: int = 0) -> list[StabilityCase]:
    """Return all cases of codec `grid` except trained packs, with about `texels` texels each."""
    random = np.random.default_rng(seed)
    plain = random_pack(SIZES, (0, 1), SMALL_CODEC)
    adapted = random_pack(
        SIZES,
        (0, 0),
        GridConfig(latent_channels=8, latent_bits=4, adapters=True, adapter_output=True, weight_bits=16),
    )
    overflow = scaled(plain, 15, 1, -16)
    many = random_pack([(4, 4)] * MANY_DECODERS, range(MANY_DECODERS), SMALL_CODEC)
    tall = random_pack(((1, 1), (1, LARGEST_SIDE), (LARGEST_SIDE, 1), (1000, 3)), (0, 1, 0, 1), SMALL_CODEC)
    zero = changed(plain, [lambda part: 0.0 * part] * 3, [lambda part: part] * 3)
    packs = {
        "random weights": plain,
        "random weights and adapters": adapted,
        "sums in another order": reordered(plain),
        "weights 2^20": scaled(plain, 20, 20, 20),
        "weights 2^-20": scaled(plain, -20, -20, -20),
        "weights 2^20, then 2^-20": scaled(plain, 20, -20, 0),
        "weights 2^-20, then 2^20": scaled(plain, -20, 20, 0),
        "weights 0": zero,
        "hidden values beyond 65504": overflow,
        "denormal halves": scaled(plain, -14, 14, 0),
        "denormal fp32": scaled(plain, -130, 0, 100),
        "weights 3e38": changed(plain, [_largest_weights] * 3, [_largest_weights] * 3),
        "latents 0": _with_latents(plain, np.zeros_like),
        "latents at both ends": _with_latents(plain, lambda stored: np.where(stored > 127, 255, 0).astype(np.uint8)),
        "1x1, 1x16384, 16384x1, 1000x3": tall,
        f"{MANY_DECODERS} decoders": many,
    }
    cases = [StabilityCase(name, pack, anywhere(pack, texels, random)) for name, pack in packs.items()]
    without = StabilityCase(
        "hidden values beyond 65504, not rescaled", overflow, anywhere(overflow, texels, random), rescale=False
    )
    long = random_pack(((LARGEST_PACK_SIDE, 2),), (0,), SMALL_CODEC)
    return [*cases, without, *place_cases(plain, long, texels, random)]


def trained_case(name: str, pack: Pack, texels: int, seed: int = 0) -> StabilityCase:
    """Return a case with random texels of all textures of a trained pack."""
    return StabilityCase(f"trained: {name}", pack, anywhere(pack, texels, np.random.default_rng(seed)))
