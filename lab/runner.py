"""Shared parts of benchmarks and studies: options, facts about the machine, progress, records, tables and plots."""

import argparse
import importlib.metadata
import io
import json
import os
import platform
import re
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from matplotlib.figure import Figure
from rich.console import Console
from rich.progress import Progress, TimeRemainingColumn
from rich.table import Table as ConsoleTable

from ntc.errors import InputError
from ntc.io import write_bytes, write_text
from viewer.gl.context import GraphicsContext
from viewer.gl.timer import PassTimer
from viewer.scene.text_table import Table

LOG_COLUMNS = 160
"""Width in characters of tables that are not printed to a terminal."""
LIBRARIES = ("numpy", "moderngl", "torch")
"""Libraries whose versions affect times."""
StepResult = TypeVar("StepResult")
Report = Callable[[int, int], None]
"""Function that is called with (finished parts of a step, parts of the step)."""
Step = Callable[[Report], StepResult]


def options(description: str | None) -> argparse.ArgumentParser:
    """Return a parser with the options of every benchmark. The help shows the first line of `description`."""
    parser = argparse.ArgumentParser(description=(description or "").split("\n")[0])
    parser.add_argument("--json", type=Path, help="write the record to this file")
    return parser


def run(main: Callable[[], int | None]) -> None:
    """Run a benchmark from the command line and exit. Bad input prints one line and exits with status 2."""
    try:
        sys.exit(main())
    except InputError as error:
        sys.stderr.write(f"error: {error}\n")
        sys.exit(2)


def machine(context: GraphicsContext | None = None) -> dict[str, Any]:
    """Return facts about the machine: processor and libraries, and with `context` renderer, driver and kind of timer."""
    facts: dict[str, Any] = {}
    if context is not None:
        facts |= {
            "renderer": context.info.renderer,
            "vendor": context.info.vendor,
            "driver": context.info.version,
            "timer": PassTimer(context).kind,
        }
    facts |= {
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "python": platform.python_version(),
        **{name: importlib.metadata.version(name) for name in LIBRARIES},
    }
    torch = sys.modules.get("torch")
    if torch is not None:
        facts |= {
            "threads": torch.get_num_threads(),
            "cuda": torch.cuda.get_device_name() if torch.cuda.is_available() else None,
        }
    return facts


def _processor() -> str:
    try:
        match = re.search(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(encoding="utf-8"), re.MULTILINE)
    except OSError:
        match = None
    return match[1] if match else platform.processor() or platform.machine()


def write_record(file: Path | None, content: Mapping[str, Any]) -> None:
    """Write the JSON record of a benchmark to `file`, if there is one. Raises InputError where it cannot be written."""
    if file is not None:
        write_text(file, json.dumps(dict(content), indent=1, allow_nan=False) + "\n")


def write_figure(path: Path, figure: Figure) -> None:
    """Write a plot as PNG. Raises InputError where it cannot be written."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=110, metadata={"Software": None})
    write_bytes(path, picture.getvalue())


def report(title: str, rows: Sequence[Mapping[str, Any]], facts: Mapping[str, Any], file: Path | None) -> None:
    """Print `rows` as a table and, where `file` is given, write them with `facts` as JSON."""
    table = ConsoleTable(title=title)
    for name in rows[0] if rows else ():
        table.add_column(name, justify="left" if isinstance(rows[0][name], str) else "right")
    for row in rows:
        table.add_row(*(f"{value:.2f}" if isinstance(value, float) else str(value) for value in row.values()))
    console = Console()
    if not console.is_terminal:
        console = Console(width=LOG_COLUMNS)
    console.print(table)
    console.print(", ".join(f"{name} {value}" for name, value in facts.items()))
    write_record(file, {**facts, "rows": [dict(row) for row in rows]})


def do_steps(
    steps: Sequence[tuple[str, Step[StepResult]]], line_about: Callable[[StepResult], str], skipped: bool = False
) -> list[StepResult]:
    """Run all steps and return their results. Progress, remaining time and a line about each result go to standard error.

    With `skipped`, a step that raises InputError is left out, and its line has the reason.
    """
    results = []
    console = Console(stderr=True, soft_wrap=True)
    with Progress(*Progress.get_default_columns()[:-1], TimeRemainingColumn(), console=console, transient=True) as bar:
        whole = bar.add_task("", total=len(steps))
        for number, (name, step) in enumerate(steps):
            bar.update(whole, description=name)

            def advance(done: int, of: int, before: int = number) -> None:
                bar.update(whole, completed=before + done / max(1, of))

            try:
                results.append(step(advance))
            except InputError as error:
                if not skipped:
                    raise
                line = f"left out: {error}"
            else:
                line = line_about(results[-1])
            bar.update(whole, completed=number + 1)
            console.print(f"{number + 1}/{len(steps)} {name}: {line}", highlight=False)
    return results


def check_output(folder: Path) -> None:
    """Check an output folder. Raises InputError where it is a file."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--out {folder}: is a file; name a folder")


@dataclass
class StudyOutput:
    """Output of a study: its folder, and the facts that its records share. Raises InputError where the folder is a file."""

    folder: Path
    context: GraphicsContext | None = None
    """OpenGL context whose renderer the records name."""
    began: float = field(default_factory=time.monotonic)

    def __post_init__(self) -> None:
        check_output(self.folder)

    def write(
        self,
        name: str,
        title: str,
        table: Table,
        figure: Figure,
        facts: Mapping[str, Any],
        rows: Sequence[Mapping[str, Any]] | None = None,
        summary: str | None = None,
    ) -> None:
        """Write NAME.md, .csv, .png and .json, and print `summary`, or the table without one. Raises InputError.

        The record has the machine, the seconds so far, `facts`, and `rows`, or the table's rows without any.
        """
        record = {
            "study": name,
            "what": title,
            **facts,
            "machine": machine(self.context),
            "seconds": time.monotonic() - self.began,
            "rows": [dict(row) for row in (table.rows if rows is None else rows)],
        }
        write_text(self.folder / f"{name}.md", f"# {title}\n\n{table.markdown()}")
        write_text(self.folder / f"{name}.csv", table.csv())
        write_figure(self.folder / f"{name}.png", figure)
        write_record(self.folder / f"{name}.json", record)
        sys.stdout.write(f"{title}\n{table.text() if summary is None else summary}")

    def end(self) -> None:
        """Print the folder of the files."""
        sys.stdout.write(f"wrote {self.folder}\n")
