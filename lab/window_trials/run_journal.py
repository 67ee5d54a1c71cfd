"""Journal of a window under trial, as lines of JSON. A killed window leaves its journal."""

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ntc.codec.model import Pack
from ntc.codec.registry import codec_of


def fingerprint(pack: Pack) -> str:
    """Return a hash of the encoded textures of a pack, equal in memory and in a file."""
    digest = hashlib.sha256()
    for texture in pack.textures:
        digest.update(texture.pixel_hash.encode())
        for values in codec_of(pack.config).texture_tensors(texture, pack.config).values():
            digest.update(values.tobytes())
    return digest.hexdigest()


class Journal:
    """Journal that appends each line to a file at once."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("a", buffering=1)

    def write(self, event: str, **facts: Any) -> None:
        """Append a line."""
        self._file.write(json.dumps({"event": event, **facts}) + "\n")


def read_journal(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the lines of a journal, without a last one that was cut off."""
    if not path.is_file():
        return
    for line in path.read_text().splitlines():
        try:
            yield json.loads(line)
        except ValueError:
            continue
