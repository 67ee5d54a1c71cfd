"""Tables of results: the same rows as Markdown, CSV and text."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

Cell = str | int | float | None


@dataclass(frozen=True)
class Column:
    """Column of a table."""

    key: str
    """Key of the value in a row."""
    heading: str
    """Heading with the unit."""
    digits: int = 2
    """Decimal places of floats."""

    def text(self, value: Cell) -> str:
        """Return a value as it is printed; `-` for none."""
        if value is None:
            return "-"
        if isinstance(value, float):
            return f"{value:.{self.digits}f}" if math.isfinite(value) else "-"
        return f"{value:,}" if isinstance(value, int) else value


@dataclass(frozen=True)
class Table:
    """Rows of values under columns; a row may lack a value."""

    columns: Sequence[Column]
    rows: Sequence[Mapping[str, Cell]]

    def _texts(self) -> list[list[str]]:
        return [[column.text(row.get(column.key)) for column in self.columns] for row in self.rows]

    def _is_number(self, column: Column) -> bool:
        return all(not isinstance(row.get(column.key), str) for row in self.rows)

    def markdown(self) -> str:
        """Return a Markdown table, numbers aligned to the right."""
        lines = ["| " + " | ".join(column.heading for column in self.columns) + " |"]
        lines.append("|" + "|".join("--:" if self._is_number(column) else "---" for column in self.columns) + "|")
        lines += ["| " + " | ".join(text.replace("|", "\\|") for text in texts) + " |" for texts in self._texts()]
        return "\n".join(lines) + "\n"

    def csv(self) -> str:
        """Return comma-separated values in full precision under the columns' keys; empty for none."""
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow([column.key for column in self.columns])
        for row in self.rows:
            values = [row.get(column.key) for column in self.columns]
            writer.writerow(["" if value is None else value for value in values])
        return buffer.getvalue()

    def text(self) -> str:
        """Return the table as text for a terminal, with aligned columns."""
        texts = [[column.heading for column in self.columns], *self._texts()]
        widths = [max(len(row[index]) for row in texts) for index in range(len(self.columns))]
        numbers = [self._is_number(column) for column in self.columns]
        lines = []
        for row in texts:
            cells = zip(row, widths, numbers, strict=True)
            lines.append("  ".join(text.rjust(width) if right else text.ljust(width) for text, width, right in cells))
        return "\n".join(line.rstrip() for line in lines) + "\n"
