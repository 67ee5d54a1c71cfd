"""Textures of codec `grid` as a pack holds them, and a pack that is shown before there is a trained one."""

from collections.abc import Sequence

import numpy as np

from ntc.codec.codec import texture_fields
from ntc.codec.grid.config import GridConfig
from ntc.codec.grid.model import Adapter, GridDecoder, GridTexture
from ntc.codec.grid.quantize import QuantizedLatents
from ntc.codec.latents import latent_cell_count
from ntc.codec.model import Grouping, Pack
from ntc.codec.textures import SourceTexture


def grid_texture(source: SourceTexture, group: int, latents: QuantizedLatents, adapter: Adapter | None) -> GridTexture:
    """`source` in `group`, encoded as `latents` and, where the codec has them, `adapter`; its PSNR is not yet known."""
    return GridTexture(
        **texture_fields(source, group),
        latents=latents.stored,
        scale=latents.scale,
        offset=latents.offset,
        adapter=adapter,
    )


def grey_pack(textures: Sequence[SourceTexture], grouping: Grouping, config: GridConfig) -> Pack:
    """A pack that decodes to mid-grey, in the groups of `grouping`: shown until the first snapshots.

    Codes have their largest size, so that what comes fits into as much memory.
    """
    shapes = config.layer_shapes
    outputs, width = shapes[-1]
    zeros = [np.zeros(shape, np.float32) for shape in shapes]
    biases = [np.zeros(shape[0], np.float32) for shape in shapes]
    grey = np.full(outputs, 0.5, np.float32)
    adapter = None
    if config.adapters:
        own = (zeros[-1], grey) if config.adapter_output else ()
        hidden = len(shapes) - 1
        adapter = Adapter(np.ones((hidden, width), np.float32), np.zeros((hidden, width), np.float32), *own)
    last = np.zeros_like(grey) if config.adapter_output else grey
    decoder = GridDecoder(tuple(zeros), (*biases[:-1], last))
    channels = config.latent_channels
    encoded = []
    for texture, group in zip(textures, grouping.groups, strict=True):
        cells = latent_cell_count(*texture.size, config)
        latents = QuantizedLatents(
            np.zeros((cells, channels), np.uint8), np.ones(channels, np.float32), np.zeros(channels, np.float32)
        )
        encoded.append(grid_texture(texture, group, latents, adapter))
    return Pack(config, grouping, tuple(encoded), (decoder,) * grouping.group_count)
