"""Measured values that are kept by content, so that what has not changed is not measured again."""

from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import msgspec

from ntc.errors import InputError
from ntc.io import read_file, write_bytes

LARGEST_VALUE = 1 << 22
"""Bytes of the largest file that is read."""

Value = TypeVar("Value")


@dataclass(frozen=True)
class KeptValues:
    """Folder with one JSON file for each content that was measured. A file that cannot be read counts as absent."""

    folder: Path

    def read(self, content: str, kind: type[Value]) -> Value | None:
        """Return the value of `content`, None where it is not kept."""
        try:
            return msgspec.json.decode(read_file(self._path(content), LARGEST_VALUE), type=kind)
        except (OSError, msgspec.DecodeError, ValueError):
            return None

    def write(self, content: str, value: object) -> None:
        """Keep `value`; where the folder cannot be written, it is measured again next time."""
        try:
            write_bytes(self._path(content), msgspec.json.encode(value))
        except InputError:
            return

    def _path(self, content: str) -> Path:
        return self.folder / f"{content}.json"
