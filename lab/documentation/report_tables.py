"""Tables of docs/reports from the committed records of lab/benchmarks/results."""

import json
from pathlib import Path
from typing import Any

from lab.benchmarks.many_textures import __main__ as many_textures

RESULTS = Path(__file__).resolve().parents[1] / "benchmarks" / "results"


def record(name: str) -> Any:
    """The JSON of a committed record, by its path below lab/benchmarks/results without suffix."""
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))


def many_textures_table() -> str:
    """Seconds and memory of scenes of 100 to 10,000 images."""
    return many_textures.table(record("many_textures_llvmpipe")["rows"])
