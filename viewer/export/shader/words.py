"""The data of a pack as exported decoders read it: one array of 32-bit words."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from ntc.codec.gpu import LEVEL_RECORD, level_records
from ntc.codec.latents import latent_levels
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of

MAGIC: Final = 0x5743544E
"""The first word: the letters NTCW."""
VERSION: Final = 1
HEADER_FIELDS: Final = (
    "magic",
    "version",
    "total_words",
    "texture_count",
    "level_count",
    "textures",
    "levels",
    "decoders",
    "latents",
    "codec",
)
"""Words of the header. `textures` to `latents`: the word where each of them begins. `codec`: what a decoder is made for."""
HEADER_WORDS: Final = 16


def pack_words(pack: Pack, codec: int) -> NDArray[np.uint32]:
    """[words] uint32, to be stored little-endian: header, texture records, level records, decoders with adapters, latents.

    `codec` is the number that tells decoders for other settings apart.
    """
    tables = codec_of(pack.config).gpu_tables(pack.config)
    records = np.zeros(len(pack.textures), tables.texture_record)
    levels: list[NDArray[np.void]] = []
    latents: list[NDArray[np.uint32]] = []
    first_level, first_cell = 0, 0
    adapter = tables.first_block + len(pack.decoders) * tables.decoder_blocks
    for record, texture in zip(records, pack.textures, strict=True):
        pyramid = latent_levels(texture.width, texture.height, pack.config)
        tables.fill_record(record, texture, first_level, adapter)
        own = level_records(pyramid)
        own["first_cell"] = [first_cell + row.first for row in tables.level_rows(texture)]
        levels.append(own)
        stored = tables.latent_words(texture, slice(None))
        latents.append(stored.reshape(-1))
        first_level += len(pyramid)
        first_cell += len(stored)
        adapter += tables.adapter_blocks
    all_levels = np.concatenate(levels) if levels else np.zeros(0, LEVEL_RECORD)
    sections = {
        "textures": np.frombuffer(records.tobytes(), "<u4"),
        "levels": np.frombuffer(all_levels.tobytes(), "<u4"),
        "decoders": np.frombuffer(tables.all_data(pack, pack.textures), "<u4"),
        "latents": np.concatenate(latents) if latents else np.zeros(0, np.uint32),
    }
    header = np.zeros(HEADER_WORDS, np.uint32)
    place = HEADER_WORDS
    values = {"magic": MAGIC, "version": VERSION, "texture_count": len(records), "level_count": len(all_levels)}
    parts = [header]
    for name, words in sections.items():
        values[name] = place
        # Sections begin at whole blocks of four words.
        parts.append(np.pad(words, (0, -len(words) % 4)))
        place += len(parts[-1])
    values |= {"total_words": place, "codec": codec}
    for name, value in values.items():
        header[HEADER_FIELDS.index(name)] = value
    return np.concatenate(parts).astype("<u4")
