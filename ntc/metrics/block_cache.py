"""Blocks of BC1, BC7 and ASTC kept on disk: encoding takes long and always gives the same."""

import hashlib
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ntc.errors import InputError
from ntc.io import is_partial, read_file, write_bytes
from ntc.metrics.block_compression import BlockFormat, Effort

VERSION = 1
"""Changes with the encoders and their settings."""
LARGEST_CACHE = 1 << 29
"""Bytes of all files: the oldest are removed beyond it."""
SUFFIX = ".blocks"
_DIGEST_BYTES = 16


@dataclass(frozen=True)
class BlockCache:
    """A folder of blocks, one file per texture, format and effort."""

    folder: Path
    largest_bytes: int = LARGEST_CACHE

    def path(self, key: str, block_format: BlockFormat, effort: Effort) -> Path:
        """Where the blocks of a texture lie; `key` stands for its pixels and their colour space."""
        digest = hashlib.sha256(f"{VERSION} {key} {block_format} {effort}".encode()).hexdigest()[:32]
        return self.folder / f"{block_format}-{digest}{SUFFIX}"

    def read(self, path: Path, size: int) -> bytes | None:
        """The `size` bytes of blocks that were written to `path`, if they are as they were written."""
        try:
            data = read_file(path, size + _DIGEST_BYTES)
        except OSError:
            return None
        digest, blocks = data[:_DIGEST_BYTES], data[_DIGEST_BYTES:]
        return blocks if len(blocks) == size and _digest(blocks) == digest else None

    def write(self, path: Path, blocks: bytes) -> None:
        """Keep `blocks` at `path`; does nothing where the folder cannot be written: then everything takes longer."""
        with suppress(InputError):
            write_bytes(path, _digest(blocks) + blocks)

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
