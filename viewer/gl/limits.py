"""Limits of a driver that requests may meet, asked of it once; and what OpenGL 4.3 guarantees, where that is enough."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

GROUPS_ACROSS: Final = 65535
"""Most work groups along one axis of a dispatch that OpenGL guarantees; more lie in several rows."""
LARGEST_INT: Final = (1 << 31) - 1


@dataclass(frozen=True)
class Limits:
    """The most that a driver allows."""

    texture_side: int
    """Texels (GL_MAX_TEXTURE_SIZE)."""
    array_layers: int
    """Layers of a texture array (GL_MAX_ARRAY_TEXTURE_LAYERS)."""
    storage_block_bytes: int
    """Bytes of a storage buffer that shaders can read (GL_MAX_SHADER_STORAGE_BLOCK_SIZE); 4.3 guarantees 16 MiB, 4.1 has none."""
    uniform_block_bytes: int
    """The same of a uniform buffer (GL_MAX_UNIFORM_BLOCK_SIZE)."""

    @classmethod
    def of(cls, info: Mapping[str, Any]) -> "Limits":
        """Those of a context, by what moderngl asked of it (`Context.info`)."""

        def most(name: str) -> int:
            # moderngl reads 32 bits with a sign, and some drivers allow 4 GiB.
            found = int(info.get(name, 0))
            return found if found > 0 else LARGEST_INT

        return cls(
            most("GL_MAX_TEXTURE_SIZE"),
            most("GL_MAX_ARRAY_TEXTURE_LAYERS"),
            most("GL_MAX_SHADER_STORAGE_BLOCK_SIZE"),
            most("GL_MAX_UNIFORM_BLOCK_SIZE"),
        )


def rows_of_work_groups(groups: int, across: int = GROUPS_ACROSS) -> tuple[int, int]:
    """(width, height) of a dispatch of at least `groups` work groups, fewer than `height` more; twin of common/work_groups.glsl."""
    rows = max(1, -(-groups // across))
    return -(-groups // rows), rows
