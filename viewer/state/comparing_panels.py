"""Which panels of the comparison are open, and what their table shows: changed by commands."""

from dataclasses import dataclass
from typing import Literal

ErrorsBy = Literal["texture", "decoder"]
ErrorColumn = Literal["name", "decoder", "pixels", "psnr", "mean", "max"]


@dataclass(frozen=True)
class ComparingPanels:
    """Immutable; the session holds the present one."""

    pixel: bool = False
    errors: bool = False
    histogram: bool = False
    errors_by: ErrorsBy = "texture"
    column: ErrorColumn = "psnr"
    """By which the table is sorted."""
    descending: bool = False
    lit_decoder: int | None = None
    """The decoder whose textures are highlighted; None also where a texture is."""


def worst_is_largest(column: ErrorColumn) -> bool:
    """Whether the worst rows are first in descending order."""
    return column in ("pixels", "mean", "max")
