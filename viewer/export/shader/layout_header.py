"""The layout of ntc_pack.bin as a header that C and C++ read."""

import numpy as np

from ntc.codec.gpu import LEVEL_RECORD
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from viewer.export.shader.languages import Heading
from viewer.export.shader.words import HEADER_FIELDS, HEADER_WORDS, MAGIC, VERSION

_SCALARS = {np.dtype("<i4"): "int32_t", np.dtype("<f4"): "float"}


def _struct(name: str, record: np.dtype) -> list[str]:
    lines = [f"struct {name} {{"]
    for field in record.names or ():
        kind = record[field]
        lengths = "".join(f"[{length}]" for length in kind.shape)
        lines.append(f"    {_SCALARS[kind.base]} {field}{lengths};")
    return [*lines, "};", f"typedef char {name}_size[sizeof(struct {name}) == {record.itemsize} ? 1 : -1];"]


def layout_header(pack: Pack, heading: Heading) -> str:
    """C: the words of the header, the records, and how many numbers a decoder and an adapter have."""
    tables = codec_of(pack.config).gpu_tables(pack.config)
    lines = [
        f"/* Layout of ntc_pack.bin, the data of {heading.pack}: made by ntc-viewer export --shader; do not edit.",
        "",
        "   An array of 32-bit words, little-endian: NTC_HEADER_WORDS words of header, then the sections that it names.",
        "   textures: struct ntc_texture_record for each texture.",
        "   levels:   struct ntc_level_record for each mip, finest first, those of one texture together.",
        "   decoders: blocks of four words: NTC_SHARED_BLOCKS that all decoders share, NTC_DECODER_BLOCKS for each decoder, then",
        "             NTC_ADAPTER_BLOCKS for each texture.",
        "   latents:  NTC_CELL_WORDS words for each cell; ntc_level_record.first_cell counts in cells. */",
        "#ifndef NTC_LAYOUT_H",
        "#define NTC_LAYOUT_H",
        "",
        "#include <stdint.h>",
        "",
        f"#define NTC_MAGIC 0x{MAGIC:08X}u",
        f"#define NTC_VERSION {VERSION}u",
        "/* Decoders and data belong together where this is the same. */",
        f"#define NTC_CODEC 0x{heading.codec:08X}u",
        f"#define NTC_HEADER_WORDS {HEADER_WORDS}",
        *(f"#define NTC_WORD_{name.upper()} {place}" for place, name in enumerate(HEADER_FIELDS)),
        f"#define NTC_SHARED_BLOCKS {tables.first_block}",
        f"#define NTC_DECODER_BLOCKS {tables.decoder_blocks}",
        f"#define NTC_ADAPTER_BLOCKS {tables.adapter_blocks}",
        f"#define NTC_CELL_WORDS {tables.row_words}",
        "",
        "/* srgb: whether base colours are sRGB values. components: a bit for each component that the texture has, four for each of",
        "   the planes base, surface, emission. levels: its mips; finest_level is 0. What follows belongs to the codec. */",
        *_struct("ntc_texture_record", tables.texture_record),
        "",
        "/* width, height: of the mip in cells or blocks. */",
        *_struct("ntc_level_record", LEVEL_RECORD),
        "",
        "#endif",
        "",
    ]
    return "\n".join(lines)
