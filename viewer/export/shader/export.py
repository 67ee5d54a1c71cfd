"""Folder of an exported decoder (`export --shader`): source, data, layout, and a reference program."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from ntc.codec.gpu import LEVEL_RECORD
from ntc.codec.latents import texture_levels
from ntc.codec.maps import map_slices
from ntc.codec.model import EncodedTexture, Pack
from ntc.codec.registry import codec_of
from ntc.io import atomic_folder
from viewer.export import ShaderLanguage
from viewer.export.shader.decoder import codec_number, planes_of
from viewer.export.shader.languages import CPP_FILE, FILES, TEMPLATES, Heading, cpp_source, shader_source
from viewer.export.shader.source import HEADER_FIELDS, HEADER_WORDS, MAGIC, VERSION, pack_words
from viewer.scene.json_text import printable

_SCALARS = {np.dtype("<i4"): "int32_t", np.dtype("<f4"): "float"}


def _struct(name: str, record: np.dtype) -> list[str]:
    lines = [f"struct {name} {{"]
    for field in record.names or ():
        kind = record[field]
        lengths = "".join(f"[{length}]" for length in kind.shape)
        lines.append(f"    {_SCALARS[kind.base]} {field}{lengths};")
    return [*lines, "};", f"typedef char {name}_size[sizeof(struct {name}) == {record.itemsize} ? 1 : -1];"]


def layout_header(pack: Pack, heading: Heading) -> str:
    """Return a C header with the data's layout: words of its header, records, and blocks per decoder and adapter."""
    tables = codec_of(pack.config).gpu_tables(pack.config)
    lines = [
        f"/* Layout of ntc_pack.bin, the data of {heading.pack}: made by ntc-viewer export --shader; do not edit.",
        "",
        "   An array of 32-bit words, little-endian: NTC_HEADER_WORDS words of header, then the sections that it names.",
        "   textures: struct ntc_texture_record for each texture.",
        "   levels:   struct ntc_level_record for each mip, finest first, those of one texture together.",
        "   decoders: blocks of four words: NTC_DECODER_BLOCKS for each decoder, then",
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


DATA_FILE: Final = "ntc_pack.bin"
LAYOUT_FILE: Final = "ntc_layout.h"
PROGRAM_FILE: Final = "ntc_reference.cpp"
TEXTURES_FILE: Final = "textures.json"


@dataclass(frozen=True)
class ExportedDecoder:
    """Summary of an exported decoder."""

    files: dict[str, int]
    """Bytes of each file, by name."""


def _texture(number: int, texture: EncodedTexture, pack: Pack) -> dict[str, Any]:
    return {
        "number": number,
        "name": texture.name,
        "width": texture.width,
        "height": texture.height,
        "mips": len(texture_levels(texture, pack.config)),
        "color_space": texture.color_space,
        "wrap": list(texture.wrap),
        "decoder": texture.group,
        "maps": {name: place.stop - place.start for name, place in map_slices(texture.maps, texture.channels).items()},
    }


def _program(pack: Pack, cpp: str) -> str:
    """Return the reference program with the planes of the codec."""
    calls = "\n".join(
        f'    if (plane == "{plane}") {{\n'
        f"        value = decoder.decode_{plane}(texture, uv, lod, wrap);\n"
        "        return true;\n"
        "    }"
        for plane in planes_of(pack)
    )
    template = (TEMPLATES / PROGRAM_FILE).read_text(encoding="utf-8")
    return template.replace("    // PLANES", calls).replace("ntc_decode.hpp", cpp)


def export_decoder(pack: Pack, language: ShaderLanguage, destination: Path) -> ExportedDecoder:
    """Write the decoder of `pack` in `language` into the folder `destination`, with its data and a C++ program that uses both.

    All files are written, or none. Raises InputError where the folder cannot be written.
    """
    # The pack is named without folders: the files go to others, and do not depend on where the pack lies.
    heading = Heading(printable(Path(pack.name).name), codec_number(pack))
    cpp = FILES["cuda"] if language == "cuda" else CPP_FILE
    textures = [_texture(number, texture, pack) for number, texture in enumerate(pack.textures)]
    written = {
        FILES[language]: shader_source(pack, language, heading).encode(),
        cpp: cpp_source(pack, heading).encode(),
        LAYOUT_FILE: layout_header(pack, heading).encode(),
        PROGRAM_FILE: _program(pack, cpp).encode(),
        TEXTURES_FILE: json.dumps(textures, indent=1, ensure_ascii=False).encode(),
        DATA_FILE: pack_words(pack, heading.codec).tobytes(),
    }
    with atomic_folder(destination, LAYOUT_FILE) as folder:
        for name, content in written.items():
            (folder / name).write_bytes(content)
    return ExportedDecoder({name: len(content) for name, content in written.items()})
