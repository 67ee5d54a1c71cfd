"""Blocks of BC1, BC7 and ASTC kept on disk: encoding takes long and always gives the same. What cannot be used is encoded again."""

import hashlib
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.textures import hash_pixels
from ntc.errors import InputError
from ntc.io import is_partial, read_file, write_bytes
from ntc.metrics.block_compression import (
    BlockCompressed,
    BlockFormat,
    Effort,
    compressed_blocks,
    compressed_bytes,
    decompress,
)

VERSION = 1
"""Changes with the encoders and their settings."""
LARGEST_CACHE = 1 << 29
"""Bytes of all files: the oldest are removed beyond it."""
SUFFIX = ".blocks"
_DIGEST_BYTES = 16


@dataclass(frozen=True)
class BlockCache:
    """A folder of blocks, one file per picture, format and effort."""

    folder: Path
    largest_bytes: int = LARGEST_CACHE

    def path(self, pixels: NDArray[np.uint8], block_format: BlockFormat, effort: Effort) -> Path:
        """Where the blocks of `pixels` [H, W, C] uint8 lie."""
        key = hashlib.sha256(f"{VERSION} {hash_pixels(pixels)} {block_format} {effort}".encode()).hexdigest()[:32]
        return self.folder / f"{block_format}-{key}{SUFFIX}"

    def blocks(self, pixels: NDArray[np.uint8], block_format: BlockFormat, effort: Effort) -> bytes:
        """The kept blocks of `pixels`, or new ones, which are kept. Raises InputError as `compressed_blocks` does."""
        path = self.path(pixels, block_format, effort)
        height, width, _ = pixels.shape
        kept = _read(path, compressed_bytes(width, height, block_format))
        if kept is not None:
            return kept
        blocks = compressed_blocks(pixels, block_format, effort)
        # Without the cache everything works, only slower.
        with suppress(InputError):
            write_bytes(path, _digest(blocks) + blocks)
        return blocks

    def compress(self, pixels: NDArray[np.uint8], block_format: BlockFormat, effort: Effort) -> BlockCompressed:
        """`ntc.metrics.block_compression.compress`, from kept blocks where there are any."""
        height, width, channels = pixels.shape
        blocks = self.blocks(pixels, block_format, effort)
        return BlockCompressed(decompress(blocks, (height, width, channels), block_format), blocks)

    def trim(self) -> None:
        """Remove the oldest files until all together have at most `largest_bytes`."""
        with suppress(OSError):
            files = [path for path in self.folder.glob(f"*{SUFFIX}") if path.is_file() and not is_partial(path)]
            status = sorted(((path.stat(), path) for path in files), key=lambda pair: pair[0].st_mtime_ns)
            excess = sum(each.st_size for each, _ in status) - self.largest_bytes
            for each, path in status:
                if excess <= 0:
                    return
                path.unlink()
                excess -= each.st_size


def _digest(blocks: bytes) -> bytes:
    return hashlib.sha256(blocks).digest()[:_DIGEST_BYTES]


def _read(path: Path, size: int) -> bytes | None:
    """The blocks of a file, if it holds exactly `size` bytes of them and they are as they were written."""
    try:
        data = read_file(path, size + _DIGEST_BYTES)
    except OSError:
        return None
    digest, blocks = data[:_DIGEST_BYTES], data[_DIGEST_BYTES:]
    return blocks if len(blocks) == size and _digest(blocks) == digest else None
