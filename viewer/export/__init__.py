"""Exports of a scene and a pack for other programs. This module holds the choices only, all that the command line needs."""

from typing import Literal

Fallback = Literal["original", "jpeg", "ktx2", "none"]
"""Images for programs that do not read packs."""
ImageFormat = Literal["png", "ktx2", "bc7", "bc1", "astc"]
"""Formats of decoded images."""
ShaderLanguage = Literal["glsl", "hlsl", "wgsl", "cuda"]
"""Languages of exported decoders."""
