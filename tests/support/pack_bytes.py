"""Reader and writer of `.ntc` files, also of wrong ones, that shares no code with the package."""

import copy
import json
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

LENGTH_BYTES = 8
"""A safetensors file begins with the length of its JSON header, a little-endian unsigned 64-bit number."""


@dataclass
class PackBytes:
    """A pack file in pieces."""

    tensors: dict[str, Any]
    """Name to {"dtype", "shape", "data_offsets"}."""
    metadata: dict[str, Any]
    """What the JSON text under `ntc` says."""
    data: bytes
    """The bytes behind the header."""

    @classmethod
    def of(cls, file: bytes) -> "PackBytes":
        """Take a well-formed file apart."""
        (length,) = struct.unpack("<Q", file[:LENGTH_BYTES])
        header = json.loads(file[LENGTH_BYTES : LENGTH_BYTES + length])
        metadata = json.loads(header.pop("__metadata__")["ntc"])
        return cls(header, metadata, file[LENGTH_BYTES + length :])

    def file(self, metadata_text: str | None = None) -> bytes:
        """The pieces as a file; `metadata_text` replaces the metadata."""
        text = json.dumps(self.metadata) if metadata_text is None else metadata_text
        header = json.dumps({"__metadata__": {"ntc": text}, **self.tensors}).encode()
        # As safetensors fills it up: a first byte that is a brace would be the sign of another program.
        header += b" " * (-len(header) % 8)
        return struct.pack("<Q", len(header)) + header + self.data

    def changed(self, change: Callable[["PackBytes"], None]) -> bytes:
        """A file from a copy that `change` has altered."""
        pieces = copy.deepcopy(self)
        change(pieces)
        return pieces.file()

    def put(self, name: str, offset: int, value: bytes) -> None:
        """Overwrite bytes of the tensor called `name`."""
        start = self.tensors[name]["data_offsets"][0] + offset
        self.data = self.data[:start] + value + self.data[start + len(value) :]
