"""Exports of a scene and a pack for other programs. This module holds the choices only, all that the command line needs."""

from collections.abc import Mapping
from typing import Final, Literal, get_args

Fallback = Literal["original", "jpeg", "ktx2", "none"]
"""Images for programs that do not read packs."""
ImageFormat = Literal["png", "ktx2", "bc7", "bc1", "astc"]
"""Formats of decoded images."""
ShaderLanguage = Literal["glsl", "hlsl", "wgsl", "cuda"]
"""Languages of exported decoders."""
ExportKind = Literal["gltf", "gltf-ktx2", "gltf-bc7", "page", "glsl", "hlsl", "wgsl", "cuda"]
EXPORTS: Final[Mapping[ExportKind, tuple[str, tuple[str, ...]]]] = {
    "gltf": ("--out", ()),
    "gltf-ktx2": ("--out", ("--as", "ktx2")),
    "gltf-bc7": ("--out", ("--as", "bc7")),
    "page": ("--web", ()),
    **{language: ("--out", ("--shader", language)) for language in get_args(ShaderLanguage)},
}
"""Option that takes the file or folder, and further options of `ntc-viewer export`, by what the window writes."""
EXPORT_NAMES: Final[Mapping[str, str]] = {
    "gltf": "glTF with the pack",
    "gltf-ktx2": "glTF with KTX2 images",
    "gltf-bc7": "glTF with BC7 images",
    "page": "web page",
    **{language: f"decoder in {language.upper()}" for language in get_args(ShaderLanguage)},
}
