"""Exports of a scene and a pack for other programs. This module holds only the choices, because the command line needs no more."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, get_args

Fallback = Literal["original", "jpeg", "ktx2", "none"]
"""Images for programs that do not read packs."""
ImageFormat = Literal["png", "ktx2", "bc7", "bc1", "astc"]
"""Formats of decoded images."""
ShaderLanguage = Literal["glsl", "hlsl", "wgsl", "cuda"]
"""Languages of exported decoders."""
ExportKind = Literal["gltf", "gltf-ktx2", "gltf-bc7", "page", "glsl", "hlsl", "wgsl", "cuda"]
EXPORT_NAMES: Final[Mapping[str, str]] = {
    "gltf": "glTF with the pack",
    "gltf-ktx2": "glTF with KTX2 images",
    "gltf-bc7": "glTF with BC7 images",
    "page": "web page",
    **{language: f"decoder in {language.upper()}" for language in get_args(ShaderLanguage)},
}


@dataclass(frozen=True)
class ExportRequest:
    """What to export, and where to. At most one of `page`, `shader` and `image_format` is set; else glTF with the pack is written."""

    scene: Path
    packs: tuple[Path, ...]
    """Packs of the scene; all but the first are for a page."""
    out: Path
    """The glTF file; of a page or a decoder the folder."""
    page: bool = False
    shader: ShaderLanguage | None = None
    image_format: ImageFormat | None = None
    fallback: Fallback = "original"


_SHADERS: Final[Mapping[str, ShaderLanguage]] = {language: language for language in get_args(ShaderLanguage)}
_IMAGES: Final[Mapping[str, ImageFormat]] = {"gltf-ktx2": "ktx2", "gltf-bc7": "bc7"}


def export_request(kind: ExportKind, scene: Path, pack: Path, folder: Path) -> ExportRequest:
    """Return the request for an export of one kind into a folder."""
    out = folder / f"{scene.stem}.gltf" if kind.startswith("gltf") else folder
    return ExportRequest(scene, (pack,), out, kind == "page", _SHADERS.get(kind), _IMAGES.get(kind))
