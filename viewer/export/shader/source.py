"""The viewer's decoding shader of a plane with the settings of a pack: GLSL without directives, but with its comments."""

import io
import re
from typing import Final

import numpy as np
import pcpp  # type: ignore[import-untyped]
from numpy.typing import NDArray

from ntc.codec.gpu import LEVEL_RECORD, SOFTWARE, level_records
from ntc.codec.latents import texture_levels
from ntc.codec.maps import CODED_PLANES, Plane
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from viewer.gl.program import ShaderLibrary
from viewer.locations import shaders_folder

MAGIC: Final = 0x5743544E
"""First word of the data: the letters NTCW."""
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
"""Words of the header. `textures` to `latents` are the words where these sections begin; `codec` is `decoder.codec_number`."""
HEADER_WORDS: Final = 16


def pack_words(pack: Pack, codec: int) -> NDArray[np.uint32]:
    """Return [words] uint32, to be stored little-endian: header, texture records, level records, decoders with adapters, latents.

    `codec` is the number of the settings (`decoder.codec_number`).
    """
    tables = codec_of(pack.config).gpu_tables(pack.config)
    records = np.zeros(len(pack.textures), tables.texture_record)
    levels: list[NDArray[np.void]] = []
    latents: list[NDArray[np.uint32]] = []
    first_level, first_cell = 0, 0
    adapter = len(pack.decoders) * tables.decoder_blocks
    for record, texture in zip(records, pack.textures, strict=True):
        pyramid = texture_levels(texture, pack.config)
        tables.fill_record(record, texture, first_level, adapter)
        records_of_levels = level_records(pyramid)
        records_of_levels["first_cell"] = [first_cell + row.first for row in tables.level_rows(texture)]
        levels.append(records_of_levels)
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


SHADER: Final = "export/decode.glsl"
ENTRY: Final = "decode"
"""Function of the source that other programs call."""
WORD_AT: Final = "word"
"""Function that other programs supply: it returns a word of the pack's data."""
STORED: Final = {
    "textures": "texture_at",
    "levels": "level_at",
    "latent_words": "latent_word",
    "weights": "weights_at",
    "table_blocks": "table_at",
}
"""Function that reads an element of each buffer of the viewer's shaders."""
_CONSTANT = re.compile(r"^\s*#define (\w+) (-?(?:0x)?[\dA-Fa-f.]+u?)\s*$", re.MULTILINE)
_BUFFER = re.compile(r"layout\(std430[^{]*\{[^}]*\};")
_UNIFORM = re.compile(r"uniform int network_blocks;")
_MARK: Final = "constant_to_keep_"


class _Conditions(pcpp.Preprocessor):  # type: ignore[misc]
    """Preprocessor that evaluates conditions and leaves comments in the text."""

    def on_comment(self, _token: object) -> bool:
        """Return True: the comment stays."""
        return True

    def on_error(self, file: str, line: int, message: str) -> None:
        """Raise AssertionError: the shaders are wrong."""
        raise AssertionError(f"{file}:{line}: {message}")


def _place(section: str) -> str:
    """Return the name of the GLSL constant for the header word that stores where `section` begins."""
    return f"HEADER_{section.upper()}"


def _reader(name: str, result: str, record: np.dtype, section: str) -> str:
    """Return the GLSL of a function that reads a record of `section` of the data."""
    lines = [
        f"{result} {name}(int number) {{",
        f"    int at = int({WORD_AT}({_place(section)})) + number * {record.itemsize // 4};",
        f"    {result} record;",
    ]
    for field in record.names or ():
        if field.startswith("padding"):
            continue
        kind, place = record[field], record.fields[field][1] // 4  # type: ignore[index]
        if kind.shape:
            read = f"vec4_at(at + {place} + 4 * i)"
            lines.append(f"    for (int i = 0; i < {kind.shape[0]}; ++i) record.{field}[i] = {read};")
        else:
            lines.append(f"    record.{field} = int({WORD_AT}(at + {place}));")
    return "\n".join([*lines, "    return record;", "}"])


def _readers(pack: Pack) -> str:
    """Return the GLSL of the functions that replace the viewer's buffers."""
    decoders, latents = _place("decoders"), _place("latents")
    vec4 = ", ".join(f"uintBitsToFloat({WORD_AT}(at + {part}))" for part in range(4))
    uvec4 = ", ".join(f"{WORD_AT}(at + {part})" for part in range(4))
    tables = codec_of(pack.config).gpu_tables(pack.config)
    are_words = tables.number_type == "u4"
    name, result = (STORED["table_blocks"], "uvec4") if are_words else (STORED["weights"], "vec4")
    header = [f"const int {_place(name)} = {place};" for place, name in enumerate(HEADER_FIELDS)]
    return "\n".join(
        [
            "// Words of the data's header.",
            *header,
            "// Four numbers of the data from word `at` on.",
            f"vec4 vec4_at(int at) {{\n    return vec4({vec4});\n}}",
            f"uvec4 uvec4_at(int at) {{\n    return uvec4({uvec4});\n}}",
            "// Record of texture `number` of the pack.",
            _reader(STORED["textures"], "TextureRecord", tables.texture_record, "textures"),
            "// Record of a mip; `number` counts the mips of all textures.",
            _reader(STORED["levels"], "LevelRecord", LEVEL_RECORD, "levels"),
            "// A word of the latents of all textures.",
            f"uint {STORED['latent_words']}(int number) {{",
            f"    return {WORD_AT}(int({WORD_AT}({latents})) + number);\n}}",
            "// Four numbers of the decoders.",
            f"{result} {name}(int number) {{",
            f"    return {result}_at(int({WORD_AT}({decoders})) + 4 * number);\n}}",
            "",
        ]
    )


def decoding_source(pack: Pack, plane: Plane) -> str:
    """Return the GLSL of constants, structs and functions that decode `plane` of a texture of `pack`; ENTRY is the last.

    The preprocessor evaluates conditions but must not replace constants, whose names make the exported source readable. A prefix hides
    their uses from it, and is removed afterwards; each constant becomes a `const`. Functions that read words replace buffers, because
    languages lay out structs differently.
    """
    tables = codec_of(pack.config).gpu_tables(pack.config)
    library = ShaderLibrary(shaders_folder(), tables.includes(SOFTWARE))
    text = library.assemble(SHADER, {"PRECISION_FP16": 0, "PLANE": CODED_PLANES.index(plane)}).text
    lines = [line for line in text.splitlines() if not line.startswith(("#version", "#line"))]
    names = dict.fromkeys(name for name, _ in _CONSTANT.findall("\n".join(lines)))
    constant_names = re.compile(rf"\b({'|'.join(names)})\b")
    marked = [line if line.lstrip().startswith("#") else constant_names.sub(rf"{_MARK}\1", line) for line in lines]
    conditions, resolved = _Conditions(), io.StringIO()
    conditions.line_directive = None
    conditions.parse("\n".join(marked) + "\n")
    conditions.write(resolved)
    text = resolved.getvalue().replace(_MARK, "")
    text = _UNIFORM.sub(f"const int network_blocks = {tables.loop_length};", text)
    # The functions that read buffers take the place of the first buffer, which follows the records.
    first = _BUFFER.search(text)
    assert first is not None, "the decoding shaders read no buffer"
    text = (
        text[: first.start()] + f"uint {WORD_AT}(int place);\n{_readers(pack)}" + _BUFFER.sub("", text[first.end() :])
    )
    macros = {name: conditions.macros[name] for name in names if name in conditions.macros}
    constants = {name: "".join(token.value for token in macro.value).strip() for name, macro in macros.items()}
    written = "\n".join(f"const {_type_of(value)} {name} = {value};" for name, value in constants.items())
    return f"{written}\n{text}"


def _type_of(value: str) -> str:
    return "uint" if value.endswith("u") else "float" if "." in value else "int"
