"""Decoding a pack of codec `block` with torch, float32 (docs/reference/codecs.md)."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ntc.codec.block.codes import bit_places, edge_places
from ntc.codec.block.config import COLOUR_BITS, LARGEST_EDGE_BITS, BlockConfig
from ntc.codec.block.model import BlockDecoder, BlockTexture, averaged_rows, block_parts
from ntc.codec.block.reference import image_of
from ntc.codec.block.storage import level_codes, level_rows
from ntc.codec.block.trellis import LARGEST_DEPTH, branch_tables, level_table, scale_values
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
        self._levels = tensor(level_table().astype(np.float32))
        sizes, modes = np.divmod(np.arange(len(config.block_words) * config.modes), config.modes)
        places = bit_places(modes, sizes, decoder, config)

        def by_size(array: NDArray[Any]) -> Tensor:
            return tensor(array.astype(np.int64)).view(len(config.block_words), config.modes, *array.shape[1:])

        self._depths, self._first = by_size(places.depths), by_size(places.first)
        self._branches, self._others = by_size(places.branches), by_size(places.others)
        self._edges = tensor(decoder.fitting_edges(config).astype(np.int64))
        self._edge_places = [tensor(edge_places(decoder, config, plane)) for plane in range(len(config.planes))]
        self._scales = tensor(scale_values(decoder.scales).astype(np.float32))
        every = [averaged_rows(decoder.basis.astype(np.float64), config, mip) for mip in range(config.mips)]
        rows = (
            np.concatenate(every, axis=1).astype(np.float32)
            * scale_values(decoder.basis_scale).astype(np.float32)[:, None]
        )
        basis = np.zeros((config.coefficients, config.code_texels, config.output_channels), np.float32)
        basis[np.arange(len(basis)), :, decoder.channels] = rows
        self._basis = tensor(basis.reshape(config.coefficients, -1))

    def coefficients(self, words: Tensor, sizes: Tensor) -> Tensor:
        """[blocks, coefficients] float32 that codes `words` [blocks, words of the largest code and two more] int64, each a word, of
        size classes `sizes` [blocks] int64 stand for."""
        modes = words[:, 0] & (self._config.modes - 1)
        depths = self._depths[sizes, modes]
        others = _bits(words, self._others[sizes, modes], LARGEST_DEPTH) & ((1 << (depths - 1).clamp(min=0)) - 1)
        branches = _bits(words, self._branches[sizes, modes], 1)
        three = _bits(words, self._first[sizes, modes][:, None] - 3, 3)[:, 0]
        state = (three & 1) << 2 | (three & 2) | three >> 2
        values = torch.zeros(depths.shape, device=words.device)
        for k in range(depths.shape[1]):
            active, branch = depths[:, k] > 0, branches[:, k]
            number = 4 * others[:, k] + self._subsets[state, branch]
            values[:, k] = torch.where(active, self._levels[depths[:, k], torch.where(active, number, 0)], 0.0)
            state = torch.where(active, self._following[state, branch], state)
        return values * self._scales[modes]

    def _with_edges(self, values: Tensor, words: Tensor, sizes: Tensor, means: Tensor, colours: Tensor) -> None:
        """Write the edge parts of codes `words` into `values` [blocks, texels of all mips, channels], which hold `means` [texels of
        all mips, channels]. `colours` [channels] bool: which are sRGB-coded."""
        config, modes = self._config, words[:, 0] & (self._config.modes - 1)
        side = config.block_side
        for plane, channels in enumerate(config.planes):
            widths, count = self._edges[sizes, modes, plane], len(channels)
            first = self._edge_places[plane][sizes, modes]
            for width in range(1, LARGEST_EDGE_BITS + 1):
                own = torch.nonzero(widths == width)[:, 0]
                if not len(own):
                    continue
                colour_places = first[own, None] + COLOUR_BITS * torch.arange(2 * count, device=words.device)
                ends = _bits(words[own], colour_places, COLOUR_BITS).view(-1, 2, 1, count) / 255.0
                step = ends[:, 1] - ends[:, 0]
                begin = first[own, None] + 2 * COLOUR_BITS * count
                places = begin + width * torch.arange(config.block_texels, device=words.device)
                numbers = _bits(words[own], places, width).view(-1, 1, side, side).float()
                for mip in range(config.mips):
                    mean, squares = (
                        torch.nn.functional.avg_pool2d(power, 1 << mip).reshape(len(own), -1, 1)
                        for power in (numbers, numbers * numbers)
                    )
                    # Of small whole numbers and powers of two: exact.
                    spread = (squares - mean * mean).sqrt() / ((1 << width) - 1)
                    shown = ends[:, 0] + step * mean / ((1 << width) - 1)
                    texels = torch.arange(config.code_texels, device=words.device)[config.texels_of_mip(mip)]
                    columns = torch.tensor(channels, device=words.device)
                    shown = torch.where(colours[columns], torch.hypot(shown, step * spread), shown)
                    if config.alpha in channels:
                        shown = shown + (means[texels[0]] - means[0])[columns]
                    values[own[:, None, None], texels[None, :, None], columns] = shown

    def blocks(self, codes: Tensor, sizes: Tensor, mean: Tensor, axes: Tensor, colours: Tensor) -> Tensor:
        """[blocks, texels of all mips of a code, channels] float32, not clamped, of `codes` [blocks, words of the largest code].
        `colours` [channels] bool: which are sRGB-coded."""
        config, parts = self._config, []
        means = mean[torch.tensor(_mip_of_texels(config), device=codes.device)]
        for part, own in zip(torch.split(codes, BLOCKS_AT_ONCE), torch.split(sizes, BLOCKS_AT_ONCE), strict=True):
            words = torch.nn.functional.pad(part, (0, 2))
            values = (self.coefficients(words, own) @ self._basis).view(len(part), -1, config.output_channels)
            flat = means.expand(len(part), -1, -1).clone()
            self._with_edges(flat, words, own, means, colours)
            parts.append(flat + values @ axes.T)
        return torch.cat(parts)


def _bits(words: Tensor, places: Tensor, count: int) -> Tensor:
    """Numbers of `count` bits, at most 32, at `places` [blocks, N] of `words` [blocks, words]."""
    word, shift = places >> 5, places & 31
    joined = words.gather(1, word) | ((words.gather(1, word + 1) & 0x7FFFFFFF) << 32)
    return (joined >> shift) & ((1 << count) - 1)


def _mip_of_texels(config: BlockConfig) -> list[int]:
    return [mip for mip, side in enumerate(config.code_sides) for _ in range(side * side)]


class _Stored(NamedTuple):
    """A texture's arrays on the device."""

    codes: Tensor
    """[blocks, words of the largest code] int64: the blocks of some levels, one after the other."""
    sizes: Tensor
    """[blocks] int64 size classes."""
    mean: Tensor
    axes: Tensor
    colours: Tensor


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
            level_codes(texture.words[row.first :], level, self._config)
            for row, level in zip(rows, geometry, strict=True)
            if level.has_own_cells or levels != slice(None)
        ]
        parts = (
            np.concatenate([each.codes for each in codes]).astype(np.int64),
            np.concatenate([each.sizes for each in codes]),
            texture.mean.copy(),
            texture.axes.copy(),
            texture.colours(self._config),
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
            own = stored._replace(codes=stored.codes[used], sizes=stored.sizes[used])
            values = decoder.blocks(*own)[row, place]
            return (values * weights[..., None].float()).sum(1)

        return decode

    def _blocks_of(self, texels: PyramidTable, texture: BlockTexture, index: Tensor) -> tuple[Tensor, Tensor]:
        """(block, texel of its code) of texels [N, 8], which `index` numbers through all levels."""
        levels = texture_levels(texture, self._config)
        level = torch.bucketize(index, texels.first[0], right=True) - 1
        inside, width = index - texels.first[0][level], texels.width[0][level]
        column, row = inside % width, inside // width
        first = torch.tensor([each.first_cell for each in levels], device=self._device)[level]
        columns = torch.tensor([each.width for each in levels], device=self._device)[level]
        mips = [self._config.texels_of_mip(each.mip_of_cell).start for each in levels]
        begin = torch.tensor(mips, device=self._device)[level]
        sides = [self._config.code_sides[each.mip_of_cell] for each in levels]
        side = torch.tensor(sides, device=self._device)[level]
        return first + row // side * columns + column // side, begin + row % side * side + column % side

    @torch.no_grad()
    def decode_image(self, texture_index: int, level: int = 0) -> NDArray[np.uint8]:
        """[h, w, channels] uint8 in the texture's colour space: mip `level`, decoded at its texel centres."""
        texture = self._textures[texture_index]
        geometry = texture_levels(texture, self._config)[level]
        self._interruption()
        values = self._decoders[texture.group].blocks(*self._stored(texture, slice(level, level + 1))).clamp(0.0, 1.0)
        own = values[:, self._config.texels_of_mip(geometry.mip_of_cell)]
        image = image_of(own.cpu().numpy(), geometry, self._config)[..., texture.places(self._config)]
        return np.asarray(np.rint(image * 255.0), np.uint8)
