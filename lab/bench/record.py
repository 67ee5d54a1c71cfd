"""Output of `ntc-viewer bench`: one record, and tables and plots beside it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from lab.runner import write_figure, write_record
from ntc.io import write_text
from viewer.scene.text_table import Table


class BenchRecord:
    """Record of a benchmark at `path`, written after each part: a stopped run loses no finished part. None writes nothing."""

    def __init__(self, path: Path | None, facts: Mapping[str, Any]) -> None:
        self._path = path
        self._content: dict[str, Any] = {"machine": dict(facts)}

    def add(self, part: str, content: Mapping[str, Any], suffix: str, title: str, table: Table) -> None:
        """Add a part to the record, and write its table as `suffix` beside it. Raises InputError where they cannot be written."""
        if self._path is None:
            return
        self._content[part] = dict(content)
        write_text(self._path.with_suffix(f"{suffix}.md"), f"# {title}\n\n{table.markdown()}")
        write_record(self._path, self._content)

    def plot(self, suffix: str, figure: Figure) -> None:
        """Write a plot as `suffix` beside the record. Raises InputError where it cannot be written."""
        if self._path is None:
            return
        write_figure(self._path.with_suffix(f"{suffix}.png"), figure)
