"""A pack whose decoders and latents are chance: what it shows means nothing, what it costs does."""

import numpy as np
from numpy.typing import NDArray

from ntc.config import CodecConfig
from ntc.latents import latent_cell_count
from ntc.pack import Adapter, Decoder, EncodedTexture, Grouping, Pack


def random_pack(textures: int, decoders: int, side: int, config: CodecConfig, seed: int = 0) -> Pack:
    """`textures` textures of `side` x `side` texels; texture i has decoder i modulo `decoders`."""
    random = np.random.default_rng(seed)

    def normal(*shape: int) -> NDArray[np.float32]:
        return random.normal(0.0, 1.0 / np.sqrt(shape[-1]), shape).astype(np.float16).astype(np.float32)

    outputs, width = config.output_channels, config.hidden_width

    def adapter() -> Adapter | None:
        if not config.adapters:
            return None
        own = (normal(outputs, width), normal(outputs)) if config.adapter_output else ()
        return Adapter(1.0 + normal(2, width), normal(2, width), *own)

    cells = latent_cell_count(side, side, config)
    channels = config.latent_channels
    made = tuple(
        EncodedTexture(
            name=str(index),
            pixel_hash=f"{index:032x}",
            width=side,
            height=side,
            channels=outputs,
            color_space="srgb",
            wrap=("repeat", "repeat"),
            category=None,
            group=index % decoders,
            latents=random.integers(0, config.largest_stored + 1, (cells, channels), np.uint8),
            scale=np.full(channels, 2.0 / config.largest_stored, np.float32),
            offset=np.full(channels, -1.0, np.float32),
            adapter=adapter(),
        )
        for index in range(textures)
    )
    shapes = config.layer_shapes
    stack = tuple(
        Decoder(tuple(normal(*shape) for shape in shapes), tuple(normal(rows) for rows, _ in shapes))
        for _ in range(decoders)
    )
    return Pack(config, Grouping("in turn", tuple(texture.group for texture in made)), made, stack)
