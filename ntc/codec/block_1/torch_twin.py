"""Decoding a pack of codec `block` with torch, float32 (docs/reference/codec-block-1.md)."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ntc.codec.block_1.codes import bit_offsets
from ntc.codec.block_1.config import BlockConfig
from ntc.codec.block_1.model import BlockDecoder, BlockTexture, block_parts
from ntc.codec.block_1.reference import image_of
from ntc.codec.block_1.trellis import level_table
from ntc.codec.block_storage import level_codes, level_rows
from ntc.codec.block_trellis import branch_tables, scale_values
from ntc.codec.config import WrapMode
from ntc.codec.latents import texture_levels
from ntc.codec.model import Pack
from ntc.codec.torch_texels import PyramidTable, TorchTexels, trilinear_corners

BLOCKS_AT_ONCE = 1 << 14


class TorchBlockDecoder:
    """The tables of one decoder on one torch device."""

    def __init__(self, decoder: BlockDecoder, config: BlockConfig, device: torch.device) -> None:
        following, subsets = branch_tables()

        def tensor(array: NDArray[Any]) -> Tensor:
            return torch.from_numpy(np.array(array)).to(device)

        self._config = config
        self._following, self._subsets = tensor(following), tensor(subsets)
        self._levels = tensor(level_table())
        depths = decoder.depths(config)
        self._depths = tensor(depths.astype(np.int64))
        self._offsets = tensor(bit_offsets(depths, config))
        self._scales = tensor(scale_values(decoder.scales).astype(np.float32))
        basis = decoder.basis.astype(np.float32) * decoder.basis_scale[:, None, None]
        self._basis = tensor(basis.reshape(config.coefficients, -1))

    def coefficients(self, codes: Tensor, sizes: Tensor) -> Tensor:
        """[blocks, coefficients] float32 that `codes` [blocks, words of the largest code] int64, each a word, of size classes `sizes`
        [blocks] int64 stand for."""
        words = torch.nn.functional.pad(codes, (0, 2))
        modes = codes[:, 0] & (self._config.modes - 1)
        depths, offsets = self._depths[sizes, modes], self._offsets[sizes, modes]
        word, shift = offsets >> 5, offsets & 31
        # An index takes 7 bits at most: two words joined are 39 bits.
        joined = words.gather(1, word) | ((words.gather(1, word + 1) & 127) << 32)
        indices = (joined >> shift) & ((1 << depths) - 1)
        values, state = torch.zeros(depths.shape, device=codes.device), torch.zeros_like(modes)
        for k in range(depths.shape[1]):
            active, branch = depths[:, k] > 0, indices[:, k] & 1
            number = 4 * (indices[:, k] >> 1) + self._subsets[state, branch]
            values[:, k] = torch.where(active, self._levels[depths[:, k], number], 0.0)
            state = torch.where(active, self._following[state, branch], state)
        return values * self._scales[modes]

    def blocks(self, codes: Tensor, sizes: Tensor, mean: Tensor, axes: Tensor) -> Tensor:
        """[blocks, texels of a block, channels] float32, not clamped."""
        config, parts = self._config, []
        for part, own in zip(torch.split(codes, BLOCKS_AT_ONCE), torch.split(sizes, BLOCKS_AT_ONCE), strict=True):
            values = (self.coefficients(part, own) @ self._basis).view(-1, config.block_texels, config.output_channels)
            parts.append(mean + values @ axes.T)
        return torch.cat(parts)


class _Stored(NamedTuple):
    """A texture's arrays on the device."""

    codes: Tensor
    """[blocks, words of the largest code] int64: the blocks of some levels, one after the other."""
    sizes: Tensor
    """[blocks] int64 size classes."""
    mean: Tensor
    axes: Tensor


class TorchBlock(TorchTexels):
    """Decodes the textures of one pack of codec `block` on one torch device. What a texture needs stays there once its texels were
    decoded."""

    texels_at_once = 1 << 16

    def __init__(self, pack: Pack, device: str | torch.device, interruption: Callable[[], None] = lambda: None) -> None:
        """`interruption` is called before each piece of an image; what it raises ends the decode."""
        super().__init__(pack, device, interruption)
        own = block_parts(pack)
        self._config, self._textures = own.config, own.textures
        self._decoders = [TorchBlockDecoder(each, self._config, self._device) for each in own.decoders]
        self._whole: dict[int, _Stored] = {}

    def _stored(self, texture: BlockTexture, levels: slice = slice(None)) -> _Stored:
        geometry = texture_levels(texture, self._config)[levels]
        rows = level_rows(texture.words, texture_levels(texture, self._config), self._config)[levels]
        codes = [
            level_codes(texture.words[first : first + count], level, self._config)
            for (first, count), level in zip(rows, geometry, strict=True)
        ]
        parts = (
            np.concatenate([each.codes for each in codes]).astype(np.int64),
            np.concatenate([each.sizes for each in codes]),
            texture.mean.copy(),
            texture.axes.copy(),
        )
        return _Stored(*(torch.from_numpy(part).to(self._device) for part in parts))

    def _decode_of(
        self, texture_index: int, wrap: tuple[WrapMode, WrapMode]
    ) -> Callable[[Tensor, Tensor, Tensor], Tensor]:
        texture = self._textures[texture_index]
        levels = texture_levels(texture, self._config)
        if texture_index not in self._whole:
            self._whole[texture_index] = self._stored(texture)
        stored, decoder = self._whole[texture_index], self._decoders[texture.group]
        sizes = [[(level.texel_width, level.texel_height) for level in levels]]
        texels = PyramidTable.of(sizes, [(wrap[0] == "repeat", wrap[1] == "repeat")], self._device)

        def decode(same: Tensor, uv: Tensor, lod: Tensor) -> Tensor:
            index, weights = trilinear_corners(texels, same, uv, lod)
            block, place = self._blocks_of(texels, texture, index)
            used, row = torch.unique(block, return_inverse=True)
            values = decoder.blocks(stored.codes[used], stored.sizes[used], stored.mean, stored.axes)[row, place]
            return (values * weights[..., None].float()).sum(1)

        return decode

    def _blocks_of(self, texels: PyramidTable, texture: BlockTexture, index: Tensor) -> tuple[Tensor, Tensor]:
        """(block, texel of the block) of texels [N, 8], which `index` numbers through all levels."""
        levels = texture_levels(texture, self._config)
        level = torch.bucketize(index, texels.first[0], right=True) - 1
        inside, width = index - texels.first[0][level], texels.width[0][level]
        column, row = inside % width, inside // width
        first = torch.tensor([each.first_cell for each in levels], device=self._device)[level]
        columns = torch.tensor([each.width for each in levels], device=self._device)[level]
        side = self._config.block_side
        return first + row // side * columns + column // side, row % side * side + column % side

    @torch.no_grad()
    def decode_image(self, texture_index: int, level: int = 0) -> NDArray[np.uint8]:
        """[h, w, channels] uint8 in the texture's colour space: mip `level`, decoded at its texel centres."""
        texture = self._textures[texture_index]
        geometry = texture_levels(texture, self._config)[level]
        self._interruption()
        values = self._decoders[texture.group].blocks(*self._stored(texture, slice(level, level + 1))).clamp(0.0, 1.0)
        image = image_of(values.cpu().numpy(), geometry, self._config.block_side)[..., texture.places(self._config)]
        return np.asarray(np.rint(image * 255.0), np.uint8)
