"""Packs of random content. They cost as much to decode as trained packs."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import LARGEST_EDGE_BITS, BlockConfig
from ntc.codec.block.model import BlockDecoder, BlockTexture, stored_scales
from ntc.codec.block.storage import BlockCodes, stored_words
from ntc.codec.config import WrapMode
from ntc.codec.grid.model import Adapter, GridConfig, GridDecoder, GridTexture
from ntc.codec.latents import latent_cell_count, latent_levels
from ntc.codec.maps import MapName, map_slices, plane_channels
from ntc.codec.model import Grouping, Pack

EDGE_SHARE = 0.3
"""Share of the modes of random tables that have an edge part in a plane."""


def _random_adapter(config: GridConfig, random: np.random.Generator) -> Adapter:
    """Return an adapter with scales around 1 and biases around 0, exact in half precision."""
    shape = (2, config.hidden_width)
    scales, biases = random.uniform(0.5, 1.5, shape), random.normal(0.0, 0.2, shape)
    parts = [scales, biases]
    if config.adapter_output:
        outputs, inputs = config.layer_shapes[-1]
        parts += [random.normal(0.0, 1.2 / np.sqrt(inputs), (outputs, inputs)), random.normal(0.5, 0.1, outputs)]
    return Adapter(*(part.astype(np.float16).astype(np.float32) for part in parts))


def _stored(values: NDArray[np.float64], config: GridConfig) -> NDArray[np.float32]:
    return values.astype(np.float16 if config.weight_bits == 16 else np.float32).astype(np.float32)


def random_pack(
    sizes: Sequence[tuple[int, int]] = ((64, 64), (40, 24), (17, 33)),
    groups: Sequence[int] = (0, 1, 0),
    config: GridConfig | None = None,
    hashes: Sequence[str] | None = None,
    wrap: tuple[WrapMode, WrapMode] = ("repeat", "repeat"),
    seed: int = 0,
) -> Pack:
    """Return a pack of textures of `sizes` (width, height) whose decoders produce values in [0, 1] and beyond."""
    config = config or GridConfig()
    random = np.random.default_rng(seed)
    textures = tuple(
        GridTexture(
            name=f"texture {index}",
            pixel_hash=hashes[index] if hashes else f"{index:032x}",
            width=width,
            height=height,
            channels=config.output_channels,
            color_space="srgb",
            wrap=wrap,
            category=None,
            group=groups[index],
            latents=random.integers(
                0,
                config.largest_stored + 1,
                (latent_cell_count(width, height, config), config.latent_channels),
                np.uint8,
            ),
            scale=(random.uniform(1.0, 3.0, config.latent_channels) / config.largest_stored).astype(np.float32),
            offset=random.uniform(-1.5, -0.5, config.latent_channels).astype(np.float32),
            adapter=_random_adapter(config, random) if config.adapters else None,
        )
        for index, (width, height) in enumerate(sizes)
    )
    decoders = tuple(
        GridDecoder(
            weights=tuple(
                _stored(random.normal(0.0, 1.2 / np.sqrt(inputs), (outputs, inputs)), config)
                for outputs, inputs in config.layer_shapes
            ),
            biases=tuple(
                _stored(random.normal(0.0, 0.1, outputs) + (0.5 if layer == 2 else 0.0), config)
                for layer, (outputs, _) in enumerate(config.layer_shapes)
            ),
        )
        for _ in range(max(groups) + 1)
    )
    return Pack(config, Grouping("random", tuple(groups), {"seed": seed}), textures, decoders)


def square_pack(textures: int, decoders: int, side: int, config: GridConfig, seed: int = 0) -> Pack:
    """Return a pack of `textures` random textures of `side` x `side` texels; texture i has decoder i modulo `decoders`.

    `decoders` is at most `textures`.
    """
    return random_pack([(side, side)] * textures, [index % decoders for index in range(textures)], config, seed=seed)


def _random_block_decoder(config: BlockConfig, random: np.random.Generator) -> BlockDecoder:
    """Return tables with nearly orthogonal basis functions and a variance of coefficients that falls as in photographs.

    Some modes have edge parts.
    """
    count = config.coefficients
    falling = 1.0 / np.arange(1, count + 1) ** 0.7
    spread = falling * random.lognormal(0.0, 0.5, (config.modes, count))
    basis = random.integers(-127, 128, (count, config.block_texels)).astype(np.int8)
    in_planes = [channel for plane in config.planes for channel in plane]
    channels = np.array(in_planes, np.uint8)[np.sort(np.arange(count) % config.output_channels)]
    scale = stored_scales(np.full(count, 1.0 / (73.0 * np.sqrt(config.block_texels))))
    scales = stored_scales(spread[:, random.permutation(count)] * np.sqrt(config.block_texels) / 4.0)
    edges = random.integers(0, LARGEST_EDGE_BITS + 1, (config.modes, len(config.planes)))
    edges *= random.random(edges.shape) < EDGE_SHARE
    return BlockDecoder(basis, channels, scale, scales, edges.astype(np.uint8))


def _random_words(
    width: int, height: int, code_mips: int | None, config: BlockConfig, random: np.random.Generator
) -> NDArray[np.uint32]:
    """Return the stored words of random codes of random sizes."""
    levels = latent_levels(width, height, config, code_mips)
    blocks = latent_cell_count(width, height, config, code_mips)
    codes = random.integers(0, 1 << 32, (blocks, config.block_words[-1]), np.uint32)
    return stored_words(BlockCodes(codes, random.integers(0, len(config.block_words), blocks)), levels, config)


def _random_axes(config: BlockConfig, random: np.random.Generator) -> NDArray[np.float32]:
    """Return random orthogonal axes for each plane."""
    axes = np.zeros((config.output_channels, config.output_channels), np.float32)
    for channels in plane_channels(config.maps, config.output_channels).values():
        indices = list(channels.values())
        axes[np.ix_(indices, indices)] = np.linalg.qr(random.normal(size=(len(indices), len(indices))))[0] * 0.4
    return axes


def random_block_pack(
    sizes: Sequence[tuple[int, int]] = ((64, 64), (40, 24), (17, 33)),
    groups: Sequence[int] = (0, 1, 0),
    config: BlockConfig | None = None,
    hashes: Sequence[str] | None = None,
    wrap: tuple[WrapMode, WrapMode] = ("repeat", "repeat"),
    seed: int = 0,
    maps: Sequence[tuple[MapName, ...]] | None = None,
    code_mips: Sequence[int | None] = (),
) -> Pack:
    """Return a pack of codec `block` with textures of `sizes` (width, height), whose texels lie in [0, 1] and beyond.

    `maps`: maps of each texture; None takes those of the codec. `code_mips`: number of each texture; empty takes the codec's.
    """
    config = config or BlockConfig()
    random = np.random.default_rng(seed)
    channels = config.output_channels
    counts = {name: place.stop - place.start for name, place in map_slices(config.maps, channels).items()}
    kinds, fewer = maps or [config.maps] * len(sizes), code_mips or [None] * len(sizes)
    textures = tuple(
        BlockTexture(
            name=f"texture {index}",
            pixel_hash=hashes[index] if hashes else f"{index:032x}",
            width=width,
            height=height,
            channels=sum(counts[name] for name in kinds[index]),
            color_space="srgb",
            wrap=wrap,
            category=None,
            group=groups[index],
            words=_random_words(width, height, fewer[index], config, random),
            code_mips=fewer[index],
            axes=_random_axes(config, random),
            mean=random.uniform(0.3, 0.7, (config.mips, channels)).astype(np.float32),
            maps=kinds[index],
        )
        for index, (width, height) in enumerate(sizes)
    )
    decoders = tuple(_random_block_decoder(config, random) for _ in range(max(groups) + 1))
    return Pack(config, Grouping("random", tuple(groups), {"seed": seed}), textures, decoders)
