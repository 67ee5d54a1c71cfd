"""Limits of an OpenGL driver, read once from the context."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

GROUPS_ACROSS: Final = 65535
"""Most work groups along one axis of a dispatch that OpenGL guarantees; more lie in several rows."""
WORD_BYTES: Final = 4
"""Number of bytes of a texel of the texture buffers that stand in for storage buffers (viewer/gl/older_glsl.py)."""
LARGEST_INT: Final = (1 << 31) - 1


@dataclass(frozen=True)
class Limits:
    """Limits of a driver."""

    texture_side: int
    """Largest side of a texture in texels (GL_MAX_TEXTURE_SIZE)."""
    array_layers: int
    """Most layers of a texture array (GL_MAX_ARRAY_TEXTURE_LAYERS)."""
    storage_block_bytes: int
    """Largest storage buffer in bytes that shaders can read; OpenGL 4.3 guarantees 16 MiB. Without compute, of a texture buffer: 4.1
    guarantees 256 KiB."""
    uniform_block_bytes: int
    """Largest uniform buffer in bytes (GL_MAX_UNIFORM_BLOCK_SIZE)."""
    groups_across: int = GROUPS_ACROSS
    """Most work groups of a dispatch in one row: GROUPS_ACROSS, or the driver's smaller limit (GL_MAX_COMPUTE_WORK_GROUP_COUNT)."""
    storage_limit: str = "GL_MAX_SHADER_STORAGE_BLOCK_SIZE"
    """Name in OpenGL of the limit that `storage_block_bytes` follows from."""

    @classmethod
    def of(cls, info: Mapping[str, Any], computes: bool = True) -> "Limits":
        """Return the limits of a context from what moderngl asked of it (`Context.info`). `computes`: as `Features.compute`."""

        def most(name: str) -> int:
            # moderngl reads 32 bits with a sign, and some drivers allow 4 GiB.
            limit = int(info.get(name, 0))
            return limit if limit > 0 else LARGEST_INT

        storage_limit = "GL_MAX_SHADER_STORAGE_BLOCK_SIZE" if computes else "GL_MAX_TEXTURE_BUFFER_SIZE"
        groups = info.get("GL_MAX_COMPUTE_WORK_GROUP_COUNT", (GROUPS_ACROSS, GROUPS_ACROSS))
        # A negative count is one beyond 31 bits, as above.
        across = min(int(groups[0]), GROUPS_ACROSS) if groups[0] > 0 else GROUPS_ACROSS
        return cls(
            most("GL_MAX_TEXTURE_SIZE"),
            most("GL_MAX_ARRAY_TEXTURE_LAYERS"),
            most(storage_limit) * (1 if computes else WORD_BYTES),
            most("GL_MAX_UNIFORM_BLOCK_SIZE"),
            across,
            storage_limit,
        )

    def rows_of_work_groups(self, groups: int) -> tuple[int, int]:
        """Return (width, height) of a dispatch of at least `groups` work groups, less than `height` more (common/work_groups.glsl)."""
        rows = max(1, -(-groups // self.groups_across))
        return -(-groups // rows), rows
