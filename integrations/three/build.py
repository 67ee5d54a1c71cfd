"""Build script of the npm package: compiles libntc to ntc.wasm with Zig (pip install ziglang), and copies the tables of grouping
`universal`."""

import hashlib
import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
WASM = HERE / "generated" / "ntc.wasm"
NTC = HERE.parents[1] / "ntc"
SOURCES = (HERE / "ntc_web.c", NTC / "c" / "ntc.c", NTC / "c" / "ntc.h")
TARGET = ("-target", "wasm32-wasi", "-mexec-model=reactor", "-msimd128", "-std=c99", "-O3", "-s")


def source_section() -> bytes:
    """Return the last section of ntc.wasm, which holds the hash of its sources."""
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in SOURCES)).hexdigest()[:16]
    content = b"\x06source" + digest.encode()
    return bytes((0, len(content))) + content


def build(out: Path) -> None:
    """Compile ntc.wasm to `out`. Raises CalledProcessError if the compiler fails."""
    compiler = (sys.executable, "-m", "ziglang", "cc")
    subprocess.run([*compiler, *TARGET, "-I", NTC / "c", *SOURCES[:2], "-o", out], check=True)
    out.write_bytes(out.read_bytes() + source_section())
    out.chmod(0o644)


def copy_tables(folder: Path) -> None:
    """Copy the tables that packs of grouping `universal` are decoded with."""
    for tables in sorted((NTC / "codec" / "block").glob("universal_*.safetensors")):
        shutil.copy(tables, folder)


if __name__ == "__main__":
    copy_tables(HERE)
    if importlib.util.find_spec("ziglang") is not None:
        build(WASM)
    elif not WASM.read_bytes().endswith(source_section()):
        sys.exit("error: ntc.wasm is of other sources: pip install ziglang")
