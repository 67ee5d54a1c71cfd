"""Builds ntc.wasm from libntc, and copies the tables of grouping `universal` beside it: python build.py (pip install ziglang)."""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
NTC = HERE.parents[1] / "ntc"
TARGET = ("-target", "wasm32-wasi", "-mexec-model=reactor", "-msimd128", "-std=c99", "-O3", "-s")


def build(folder: Path) -> None:
    """Write ntc.wasm and the tables into `folder`. Raises CalledProcessError where the compiler fails."""
    sources = (HERE / "ntc_web.c", NTC / "c" / "ntc.c")
    compiler = (sys.executable, "-m", "ziglang", "cc")
    subprocess.run([*compiler, *TARGET, "-I", NTC / "c", *sources, "-o", folder / "ntc.wasm"], check=True)
    for tables in sorted((NTC / "codec" / "block").glob("universal_*.safetensors")):
        shutil.copy(tables, folder)


if __name__ == "__main__":
    if importlib.util.find_spec("ziglang") is None:
        sys.exit("error: Zig's compiler is missing: pip install ziglang")
    build(HERE)
