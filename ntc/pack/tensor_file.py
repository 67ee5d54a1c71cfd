"""What stands in front of the tensors of a safetensors file that is in memory.

Files are read whole (`ntc.reading`) and not mapped: a mapped file that somebody shortens would end the process.
"""

import json
from collections.abc import Mapping
from typing import Any

LENGTH_BYTES = 8
"""A safetensors file begins with the length of its JSON header."""


def file_metadata(data: bytes) -> Mapping[str, Any]:
    """The metadata of a file that safetensors has accepted; empty where it has none."""
    length = int.from_bytes(data[:LENGTH_BYTES], "little")
    header = json.loads(data[LENGTH_BYTES : LENGTH_BYTES + length])
    return header.get("__metadata__") or {}
