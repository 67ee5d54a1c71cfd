"""The files of a pack's decoder in each language: heading, support functions, and the translated items."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from ntc.codec.model import Pack
from viewer.export import ShaderLanguage
from viewer.export.shader import hlsl, wgsl
from viewer.export.shader.c_like import CLikeWriter
from viewer.export.shader.cpp import CppWriter
from viewer.export.shader.decoder import decoder_items, planes_of, prefixed

TEMPLATES: Final = Path(__file__).resolve().parent / "templates"
FILES: Final[dict[ShaderLanguage, str]] = {
    "glsl": "ntc_decode.glsl",
    "hlsl": "ntc_decode.hlsl",
    "wgsl": "ntc_decode.wgsl",
    "cuda": "ntc_decode.cuh",
}
CPP_FILE: Final = "ntc_decode.hpp"
_GLSL_SUPPORT: Final = """// The words of ntc_pack.bin. Another source of words will do as well: change ntc_word alone.
#ifndef NTC_BINDING
#define NTC_BINDING 0
#endif
layout(std430, binding = NTC_BINDING) readonly buffer NtcWords {
    uint ntc_words[];
};
uint ntc_word(int place) {
    return ntc_words[place];
}

// The upper 32 bits of a product.
uint ntc_product_high(uint a, uint b) {
    uint high, low;
    umulExtended(a, b, high, low);
    return high;
}
"""
_HLSL_SUPPORT: Final = f"""// The words of ntc_pack.bin. Another source of words will do as well: change ntc_word alone.
#ifndef NTC_REGISTER
#define NTC_REGISTER t0
#endif
StructuredBuffer<uint> ntc_words : register(NTC_REGISTER);
uint ntc_word(int place) {{
    return ntc_words[place];
}}

{hlsl.SUPPORT}"""
_WGSL_SUPPORT: Final = f"""// The words of ntc_pack.bin. Another source of words will do as well: change ntc_word alone.
@group(0) @binding(0) var<storage, read> ntc_words: array<u32>;
fn ntc_word(place: i32) -> u32 {{
    return ntc_words[place];
}}

{wgsl.SUPPORT}"""


@dataclass(frozen=True)
class Heading:
    """Data of the first lines of a file."""

    pack: str
    """Name of the pack's file, in one line and without folders: comments hold it."""
    codec: int
    """`codec_number` of the pack."""


def _opening(pack: Pack, heading: Heading, calls: str) -> str:
    """Return the comments at the top of a file."""
    planes = planes_of(pack)
    maps = {
        "base": "base colour, and coverage last (grey textures: the first component alone)",
        "surface": "normal x and y as (n + 1) / 2, roughness, metalness",
        "emission": "emissive colour, occlusion",
        "coverage": "coverage, in the first component",
    }
    return "\n".join(
        [
            f"// Decoder of the textures in {heading.pack}, codec {heading.codec:08x}.",
            "// Made by ntc-viewer export --shader from the viewer's shaders; do not edit.",
            "//",
            "// Functions to call, and the components of their results:",
            *(f"// {calls.format(plane=plane)}: {maps[plane]}" for plane in planes),
            "//",
            "// They read ntc_pack.bin, an array of 32-bit words with the layout in ntc_layout.h, and every other data file whose",
            "// header names the same codec. They filter like a trilinear sampler. The caller computes `lod` from its derivatives.",
            "",
            "",
        ]
    )


def shader_source(pack: Pack, language: ShaderLanguage, heading: Heading) -> str:
    """Return the text of the decoder in `language`. Raises UnsupportedSourceError."""
    if language == "cuda":
        return cpp_source(pack, heading)
    items = decoder_items(pack, prefixed)
    calls = {
        "glsl": "vec4 ntc_decode_{plane}(int texture_number, vec2 uv, float lod, ivec2 wrap)",
        "hlsl": "float4 ntc_decode_{plane}(int texture_number, float2 uv, float lod, int2 wrap)",
        "wgsl": "fn ntc_decode_{plane}(texture_number: i32, uv: vec2<f32>, lod: f32, wrap: vec2<i32>) -> vec4<f32>",
    }
    support = {"glsl": _GLSL_SUPPORT, "hlsl": _HLSL_SUPPORT, "wgsl": _WGSL_SUPPORT}[language]
    writer = {"glsl": CLikeWriter, "hlsl": hlsl.HlslWriter, "wgsl": wgsl.WgslWriter}[language]()
    return f"{_opening(pack, heading, calls[language])}{support}\n{writer.items(items)}"


def cpp_source(pack: Pack, heading: Heading) -> str:
    """Return the decoder as a header of C++ 17 that CUDA compiles as well. Raises UnsupportedSourceError."""
    call = "vec4 ntc::decoder::decode_{plane}(int texture_number, vec2 uv, float lod, ivec2 wrap)"
    members = CppWriter().items(decoder_items(pack, lambda name: name))
    template = (TEMPLATES / "decode.hpp").read_text(encoding="utf-8")
    return _opening(pack, heading, call) + template.replace("    // MEMBERS\n", members)
