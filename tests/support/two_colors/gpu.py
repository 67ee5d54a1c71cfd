"""Packs of codec `two_colors` as two_colors.glsl reads them: a row of words for each block, and no decoders."""

from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec.gpu import DecoderVariant, GpuTables, StoredRows, TextureFields
from ntc.codec.latents import texture_levels
from ntc.codec.model import Decoder, EncodedTexture
from tests.support.two_colors.model import PLANE_WORDS, SIDE, TwoColorsConfig, TwoColorsTexture


class TwoColorsTables(GpuTables):
    """Blocks as files hold them."""

    number_type = "u4"
    decoder_blocks = 0
    shader = "generated/two_colors.glsl"
    record_fields: TextureFields = ()

    def __init__(self, settings: TwoColorsConfig) -> None:
        super().__init__(settings)
        self.row_words = PLANE_WORDS * len(settings.planes)

    def decoder_data(self, decoder: Decoder) -> bytes:
        return b""

    def fill_record_fields(self, record: np.void, texture: EncodedTexture) -> None:
        """There are none."""

    def level_rows(self, texture: EncodedTexture) -> tuple[StoredRows, ...]:
        levels = texture_levels(texture, self.settings)
        return tuple(StoredRows(level.first_cell, level.cells) for level in levels)

    def latent_words(self, texture: EncodedTexture, rows: slice) -> NDArray[np.uint32]:
        return np.ascontiguousarray(cast(TwoColorsTexture, texture).blocks[rows]).view("<u4")

    def includes(self, variant: DecoderVariant) -> dict[str, str]:
        """The shader lies beside this file, not in shaders/ntc."""
        return {**super().includes(variant), self.shader: Path(__file__).with_name("two_colors.glsl").read_text()}

    def defines(self) -> list[str]:
        return [f"#define BLOCK_SIDE {SIDE}", f"#define PLANE_WORDS {PLANE_WORDS}"]
