"""What compressing a pack's file would save on disk: as it is, and with its words by planes of bytes.

python -m lab.benchmarks.pack_compression F.ntc ... --json FILE
"""

import argparse
import json
import lzma
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from safetensors.numpy import load

from ntc.io import write_text

ZSTD_LEVEL = "-19"


def _zstd(content: bytes) -> int:
    return len(subprocess.run(["zstd", ZSTD_LEVEL, "-c", "-q"], input=content, capture_output=True, check=True).stdout)


def _lzma(content: bytes) -> int:
    return len(lzma.compress(content, preset=9 | lzma.PRESET_EXTREME))


def by_planes(content: bytes) -> bytes:
    """A pack's bytes with the words of each texture as four planes of bytes, and tables by column."""
    header = 8 + int.from_bytes(content[:8], "little")
    tensors = load(content)
    arranged = [np.ascontiguousarray(np.moveaxis(tensors[name], -1, 0)).tobytes() for name in sorted(tensors)]
    return content[:header] + b"".join(arranged)


def saved_percent(content: bytes) -> Mapping[str, float]:
    """Percent of a pack's bytes that each way of compressing saves; zstd where its program is installed."""
    ways: dict[str, Callable[[bytes], int]] = {"LZMA": _lzma}
    if shutil.which("zstd"):
        ways["zstd 19"] = _zstd
    arranged = {"as it is": content, "by planes of bytes": by_planes(content)}
    return {
        f"{name}, {order}": 100.0 * (1.0 - way(given) / len(content))
        for name, way in ways.items()
        for order, given in arranged.items()
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, and write a record."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("packs", type=Path, nargs="+")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(arguments)
    found = []
    for path in options.packs:
        content = path.read_bytes()
        found.append({"pack": path.name, "bytes": len(content), "saved_percent": saved_percent(content)})
        print(json.dumps(found[-1]), flush=True)
    if options.json:
        write_text(options.json, json.dumps(found, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
