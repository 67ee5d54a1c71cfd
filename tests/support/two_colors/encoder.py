"""Encoding in codec `two_colors`: the ends of each block's texels along their principal axis."""

from collections.abc import Callable, Generator, Iterator, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec.codec import texture_fields
from ntc.codec.encoding import EncodedGroup, Encoder, EncodingProgress, EncodingTask, Piece
from ntc.codec.latents import latent_cell_count, latent_levels
from ntc.codec.maps import channel_places
from ntc.codec.mips import mip_chain
from ntc.codec.model import Decoder, EncodedTexture
from ntc.codec.quality import measured_texture, mse_of_psnr
from ntc.codec.textures import SourceTexture
from tests.support.two_colors.model import SIDE, TwoColorsConfig, TwoColorsTexture
from tests.support.two_colors.reference import decode_image

BLOCKS_AT_ONCE = 1 << 12
HIGHEST_PSNR_DB = 120.0
"""PSNR that is reported for exact textures."""


def plane_codes(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    """[blocks, 12] uint8 of the texels `values` [blocks, 16, 4], 0 to 255, of one plane."""
    centred = values - values.mean(1, keepdims=True)
    axis = np.linalg.eigh(np.einsum("ntc,ntd->ncd", centred, centred))[1][:, None, :, -1]
    along = (centred * axis).sum(-1, keepdims=True)
    ends = [values.mean(1) + axis[:, 0] * end for end in (along.min(1), along.max(1))]
    first, second = (np.clip(np.rint(end), 0.0, 255.0) for end in ends)
    line = (second - first)[:, None]
    share = ((values - first[:, None]) * line).sum(-1) / np.maximum((line * line).sum(-1), 1e-9)
    indices = np.rint(3.0 * np.clip(share, 0.0, 1.0)).astype(np.uint8).reshape(-1, SIDE, SIDE)
    packed = (indices << (2 * np.arange(SIDE, dtype=np.uint8))).sum(-1, dtype=np.uint8)
    return np.concatenate([first.astype(np.uint8), second.astype(np.uint8), packed], axis=1)


def texture_of(
    source: SourceTexture, group: int, config: TwoColorsConfig, worked: Callable[[int], None] = lambda _: None
) -> TwoColorsTexture:
    """`source` in `group`; `worked` is called often, with the blocks encoded since."""
    levels = latent_levels(*source.size, config)
    places = list(channel_places(source.maps, source.channels, config.maps, config.output_channels))
    parts = []
    for level, mip in zip(levels, mip_chain(source.pixels, source.color_space, source.maps), strict=False):
        image = np.zeros((*mip.shape[:2], config.output_channels), np.uint8)
        image[..., places] = mip
        padding = [(0, -size % SIDE) for size in mip.shape[:2]]
        tiles = np.pad(image, [*padding, (0, 0)], mode="edge").reshape(level.height, SIDE, level.width, SIDE, -1)
        blocks = tiles.swapaxes(1, 2).reshape(level.cells, SIDE * SIDE, -1)
        for start in range(0, level.cells, BLOCKS_AT_ONCE):
            chunk = blocks[start : start + BLOCKS_AT_ONCE]
            planes = []
            for channels in config.planes.values():
                values = np.zeros((*chunk.shape[:2], 4))
                values[..., list(channels)] = chunk[..., list(channels.values())]
                planes.append(plane_codes(values))
            parts.append(np.concatenate(planes, axis=1))
            worked(len(chunk))
    return TwoColorsTexture(**texture_fields(source, group), blocks=np.concatenate(parts))


class TwoColorsEncoder(Encoder):
    """A texture is a piece of work."""

    def __init__(self, task: EncodingTask) -> None:
        self._task, self.settings = task, task.settings
        self._config = cast(TwoColorsConfig, task.settings)
        self._encoded: dict[int, TwoColorsTexture] = {}
        self._members = [index for group in task.groups for index in task.grouping.members(group)]
        cells = (latent_cell_count(*task.textures[index].size, self._config) for index in self._members)
        self._blocks, self._done = sum(cells), 0

    def _worked(self, blocks: int) -> None:
        self._done += blocks
        self._task.interruption()

    def pieces(self) -> Generator[Piece]:
        for group in self._task.groups:
            members = self._task.grouping.members(group)
            for index in members:
                texture = texture_of(self._task.textures[index], group, self._config, self._worked)
                self._encoded[index] = self.measured((texture,), Decoder(), (index,))[0]
                yield Piece(ended=(group,) if index == members[-1] else ())

    def figures(self) -> EncodingProgress:
        qualities = {index: min(each.psnr_db or 0.0, HIGHEST_PSNR_DB) for index, each in self._encoded.items()}
        errors: dict[int, list[float]] = {}
        for index, decibels in qualities.items():
            errors.setdefault(self._encoded[index].group, []).append(mse_of_psnr(decibels) / 255.0**2)
        return EncodingProgress(
            share=self._done / max(1, self._blocks),
            passes=float(self._blocks * SIDE * SIDE),
            step=min(len(qualities) + 1, len(self._members)),
            steps=len(self._members),
            texels=self._done * SIDE * SIDE,
            losses={group: float(np.mean(of_group)) for group, of_group in errors.items()},
            psnr_db=qualities,
            work="encoding texture",
        )

    def encoded(self, groups: Sequence[int]) -> Iterator[EncodedGroup]:
        for group in groups:
            members = self._task.grouping.members(group)
            yield EncodedGroup(group, members, tuple(self._encoded[index] for index in members), Decoder())

    def measured(
        self, textures: Sequence[EncodedTexture], decoder: Decoder, members: Sequence[int]
    ) -> tuple[TwoColorsTexture, ...]:
        encoded = [cast(TwoColorsTexture, texture) for texture in textures]
        sources = [self._task.textures[index].pixels for index in members]
        return tuple(
            measured_texture(texture, decode_image(texture, self._config), pixels)
            for texture, pixels in zip(encoded, sources, strict=True)
        )

    def record(self) -> dict[str, Any]:
        return {"codec": self.settings.kind}
