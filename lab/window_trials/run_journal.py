"""What a window under trial did, as lines of JSON: a window that is killed leaves what it wrote so far."""

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ntc.codec.model import Pack
from ntc.codec.registry import codec_of


def fingerprint(pack: Pack) -> str:
    """Identifies what a pack decodes to, in memory and in a file."""
    digest = hashlib.sha256()
    for texture in pack.textures:
        digest.update(texture.pixel_hash.encode())
        for values in codec_of(pack.config).texture_tensors(texture, pack.config).values():
            digest.update(values.tobytes())
    return digest.hexdigest()


class Journal:
    """Appends lines to a file, each as soon as it is known."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("a", buffering=1)

    def write(self, event: str, **facts: Any) -> None:
        """One line."""
        self._file.write(json.dumps({"event": event, **facts}) + "\n")


def read_journal(path: Path) -> Iterator[dict[str, Any]]:
    """The lines of a journal; a last one that was cut off is left out."""
    if not path.is_file():
        return
    for line in path.read_text().splitlines():
        try:
            yield json.loads(line)
        except ValueError:
            continue
