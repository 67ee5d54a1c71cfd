"""What a study leaves: the table as Markdown and CSV, the plot, and a record of everything as JSON, which is written last."""

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from ntc.errors import InputError
from ntc.io import write_bytes, write_text
from viewer.cli.table import Table

DOTS_PER_INCH = 110


def write_study(folder: Path, name: str, title: str, table: Table, figure: Figure, record: Mapping[str, Any]) -> None:
    """Write NAME.md, .csv, .png and .json into `folder`. Raises InputError where it cannot be written."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    write_text(folder / f"{name}.md", f"# {title}\n\n{table.markdown()}")
    write_text(folder / f"{name}.csv", table.csv())
    write_bytes(folder / f"{name}.png", picture.getvalue())
    write_text(folder / f"{name}.json", json.dumps(record, indent=1, allow_nan=False) + "\n")


def check_output(folder: Path) -> None:
    """Raises InputError where `folder` is a file."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--out {folder}: is a file; name a folder")
