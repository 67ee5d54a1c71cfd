"""Output of `ntc-viewer bench`: one record, and tables and plots beside it."""

import importlib.metadata
import io
import json
import os
import platform
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ntc.io import write_bytes, write_text
from viewer.cli.table import Table
from viewer.gl.context import GraphicsContext
from viewer.gl.timer import PassTimer


def _processor() -> str:
    try:
        found = re.search(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(encoding="utf-8"), re.MULTILINE)
    except OSError:
        found = None
    return found[1] if found else platform.processor() or platform.machine()


def machine(context: GraphicsContext) -> dict[str, Any]:
    """Renderer, driver, machine, and how times are measured."""
    return {
        "renderer": context.info.renderer,
        "vendor": context.info.vendor,
        "driver": context.info.version,
        "timer": PassTimer(context).kind,
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "moderngl": importlib.metadata.version("moderngl"),
        "numpy": np.__version__,
    }


def write_figure(path: Path, figure: Figure) -> None:
    """Write a plot as PNG. Raises InputError where it cannot be written."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=110, metadata={"Software": None})
    write_bytes(path, picture.getvalue())


class BenchRecord:
    """Record at `path`, written again with each part, so that a stopped run keeps what is done. None: nothing is written."""

    def __init__(self, path: Path | None, facts: Mapping[str, Any]) -> None:
        self._path = path
        self._content: dict[str, Any] = {"machine": dict(facts)}

    def add(self, part: str, content: Mapping[str, Any], suffix: str, title: str, table: Table) -> None:
        """Keep a part, and write its table as `suffix` beside the record. Raises InputError where that cannot be written."""
        if self._path is None:
            return
        self._content[part] = dict(content)
        write_text(self._path.with_suffix(f"{suffix}.md"), f"# {title}\n\n{table.markdown()}")
        write_text(self._path, json.dumps(self._content, indent=1, allow_nan=False) + "\n")

    def plot(self, suffix: str, figure: Figure) -> None:
        """Write a plot as `suffix` beside the record. Raises InputError where that cannot be written."""
        if self._path is None:
            return
        write_figure(self._path.with_suffix(f"{suffix}.png"), figure)
