"""Neural texture compression as a library: packs of textures whose decoders are shared by groups.

Textures are arrays of 8-bit pixels; `encode` makes a `Pack` of them, `write_pack` and `read_pack` store it as a `.ntc` file, `decode`
gives pixels back. Nothing here opens a window or needs a display, and torch is imported by what computes with it alone.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ntc.api import decode, decode_maps, decode_to_moderngl, decode_to_torch, encode, material, mip_count, texture
    from ntc.codec.config import GroupingConfig
    from ntc.codec.encoding import BitsTarget, QualityTarget, SizeTarget
    from ntc.codec.grid.training.config import TrainingConfig
    from ntc.codec.model import EncodedTexture, Grouping, Pack
    from ntc.codec.quality import psnr_db
    from ntc.codec.reference import decode_texels
    from ntc.codec.textures import SourceTexture
    from ntc.errors import InputError, TrainingCancelledError, TrainingFailedError
    from ntc.grouping import GroupingInputs, make_grouping
    from ntc.metrics.divergence import DivergenceStatistics, divergence_map
    from ntc.metrics.metrics import bits_with_mips, psnr_table
    from ntc.pack.file import read_pack, write_pack

__all__ = [
    "BitsTarget",
    "DivergenceStatistics",
    "EncodedTexture",
    "Grouping",
    "GroupingConfig",
    "GroupingInputs",
    "InputError",
    "Pack",
    "QualityTarget",
    "SizeTarget",
    "SourceTexture",
    "TrainingCancelledError",
    "TrainingConfig",
    "TrainingFailedError",
    "bits_with_mips",
    "decode",
    "decode_maps",
    "decode_texels",
    "decode_to_moderngl",
    "decode_to_torch",
    "divergence_map",
    "encode",
    "make_grouping",
    "material",
    "mip_count",
    "psnr_db",
    "psnr_table",
    "read_pack",
    "texture",
    "write_pack",
]

_PLACES = {
    "ntc.api": (
        "decode",
        "decode_maps",
        "decode_to_moderngl",
        "decode_to_torch",
        "encode",
        "material",
        "mip_count",
        "texture",
    ),
    "ntc.codec.encoding": ("BitsTarget", "QualityTarget", "SizeTarget"),
    "ntc.codec.config": ("GroupingConfig",),
    "ntc.codec.model": ("EncodedTexture", "Grouping", "Pack"),
    "ntc.codec.quality": ("psnr_db",),
    "ntc.codec.reference": ("decode_texels",),
    "ntc.codec.textures": ("SourceTexture",),
    "ntc.errors": ("InputError", "TrainingCancelledError", "TrainingFailedError"),
    "ntc.grouping": ("GroupingInputs", "make_grouping"),
    "ntc.metrics.divergence": ("DivergenceStatistics", "divergence_map"),
    "ntc.metrics.metrics": ("bits_with_mips", "psnr_table"),
    "ntc.pack.file": ("read_pack", "write_pack"),
    "ntc.codec.grid.training.config": ("TrainingConfig",),
}
_MODULES = {name: module for module, names in _PLACES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Return what is exported, imported when it is first asked for."""
    if name not in _MODULES:
        raise AttributeError(f"module 'ntc' has no attribute {name!r}")
    found = getattr(import_module(_MODULES[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """Return the exported names, for completion."""
    return sorted({*globals(), *__all__})
