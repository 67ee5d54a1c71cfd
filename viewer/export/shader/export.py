"""`export --shader`: writes the folder of a decoder."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from ntc.codec.latents import latent_levels
from ntc.codec.maps import map_slices
from ntc.codec.model import EncodedTexture, Pack
from ntc.io import atomic_folder
from viewer.export import ShaderLanguage
from viewer.export.shader.decoder import codec_number, planes_of
from viewer.export.shader.languages import CPP_FILE, FILES, TEMPLATES, Heading, cpp_source, shader_source
from viewer.export.shader.layout_header import layout_header
from viewer.export.shader.words import pack_words
from viewer.scene.json_text import printable

DATA_FILE: Final = "ntc_pack.bin"
LAYOUT_FILE: Final = "ntc_layout.h"
PROGRAM_FILE: Final = "ntc_reference.cpp"
TEXTURES_FILE: Final = "textures.json"


@dataclass(frozen=True)
class ExportedDecoder:
    """What has been written."""

    files: dict[str, int]
    """Bytes by name."""


def _texture(number: int, texture: EncodedTexture, pack: Pack) -> dict[str, Any]:
    return {
        "number": number,
        "name": texture.name,
        "width": texture.width,
        "height": texture.height,
        "mips": len(latent_levels(texture.width, texture.height, pack.config)),
        "color_space": texture.color_space,
        "wrap": list(texture.wrap),
        "decoder": texture.group,
        "maps": {name: place.stop - place.start for name, place in map_slices(texture.maps, texture.channels).items()},
    }


def _program(pack: Pack, cpp: str) -> str:
    """The reference program for the planes that the codec has."""
    calls = "\n".join(
        f'    if (plane == "{plane}") {{\n'
        f"        found = decoder.decode_{plane}(texture, uv, lod, wrap);\n"
        "        return true;\n"
        "    }"
        for plane in planes_of(pack)
    )
    template = (TEMPLATES / PROGRAM_FILE).read_text(encoding="utf-8")
    return template.replace("    // PLANES", calls).replace("ntc_decode.hpp", cpp)


def export_decoder(pack: Pack, language: ShaderLanguage, destination: Path) -> ExportedDecoder:
    """Write into the folder `destination` the decoder of `pack` in `language`, its data, and a program in C++ that uses both.

    All or nothing. Raises InputError where the folder cannot be written.
    """
    # Without its folders: what is written goes to others, and is the same wherever the pack lies.
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
