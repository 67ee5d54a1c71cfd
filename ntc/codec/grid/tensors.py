"""Stored form of textures of codec `grid`: latents rounded and packed. Also the grey pack that is shown before the first snapshot."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.codec import texture_fields
from ntc.codec.grid.model import Adapter, GridConfig, GridDecoder, GridTexture
from ntc.codec.latents import latent_cell_count
from ntc.codec.model import Grouping, Pack
from ntc.codec.textures import SourceTexture


@dataclass(frozen=True, eq=False)
class QuantizedLatents:
    """Latents as integers: value = offset + scale * stored."""

    stored: NDArray[np.uint8]
    """[cells, channels] uint8, one integer per byte for any number of bits."""
    scale: NDArray[np.float32]
    """[channels] float32, positive."""
    offset: NDArray[np.float32]
    """[channels] float32."""

    def values(self) -> NDArray[np.float64]:
        """Return [cells, channels] float64: the latent values."""
        return self.offset.astype(np.float64) + self.scale.astype(np.float64) * self.stored


def quantize_latents(
    values: NDArray[np.float32], low: NDArray[np.float32], high: NDArray[np.float32], largest: int
) -> QuantizedLatents:
    """Round `values` [cells, channels] to integers: 0 is `low` [channels], `largest` is `high` [channels]. Values beyond are clamped.

    Raises ValueError for values that are not finite.
    """
    if not (np.isfinite(values).all() and np.isfinite(low).all() and np.isfinite(high).all()):
        raise ValueError("latents are not finite")
    scale = (np.maximum(high - low, np.float32(1e-6)) / np.float32(largest)).astype(np.float32)
    stored = np.clip(np.rint((values - low) / scale), 0, largest).astype(np.uint8)
    return QuantizedLatents(stored, scale, low.astype(np.float32))


def packed_cells(stored: NDArray[np.uint8], bits: int) -> NDArray[np.uint8]:
    """Return [cells, channels * bits / 8] uint8: `stored` [cells, channels] as files hold it. With 4 bits, a byte holds two integers,
    the first in its low half."""
    if bits == 8:
        return np.ascontiguousarray(stored)
    return np.ascontiguousarray(stored[:, 0::2] | (stored[:, 1::2] << 4))


def unpacked_cells(packed: NDArray[np.uint8], bits: int) -> NDArray[np.uint8]:
    """Return [cells, channels] uint8, one integer per byte, of `packed` from `packed_cells`."""
    if bits == 8:
        return packed
    return np.stack([packed & 15, packed >> 4], axis=-1).reshape(len(packed), -1)


def grid_texture(source: SourceTexture, group: int, latents: QuantizedLatents, adapter: Adapter | None) -> GridTexture:
    """Return the encoded texture of `source` in `group`, with `latents` and `adapter`; its PSNR is None."""
    return GridTexture(
        **texture_fields(source, group),
        latents=latents.stored,
        scale=latents.scale,
        offset=latents.offset,
        adapter=adapter,
    )


def grey_pack(textures: Sequence[SourceTexture], grouping: Grouping, config: GridConfig) -> Pack:
    """Return a pack that decodes to mid-grey, in the groups of `grouping`: shown until the first snapshots.

    Latents have their final size, so trained ones fit into the same memory.
    """
    shapes = config.layer_shapes
    outputs, width = shapes[-1]
    zeros = [np.zeros(shape, np.float32) for shape in shapes]
    biases = [np.zeros(shape[0], np.float32) for shape in shapes]
    grey = np.full(outputs, 0.5, np.float32)
    adapter = None
    if config.adapters:
        output = (zeros[-1], grey) if config.adapter_output else ()
        hidden = len(shapes) - 1
        adapter = Adapter(np.ones((hidden, width), np.float32), np.zeros((hidden, width), np.float32), *output)
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
