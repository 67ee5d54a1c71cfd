"""One table in three forms."""

import csv
import io

from viewer.cli.table import Column, Table

TABLE = Table(
    (Column("name", "name"), Column("excess", "excess"), Column("cut", "cut %", 1)),
    ({"name": "a|b", "excess": 12345, "cut": 12.34}, {"name": "c", "cut": float("inf")}, {"name": "d", "cut": None}),
)


def test_markdown() -> None:
    assert TABLE.markdown() == (
        "| name | excess | cut % |\n|---|--:|--:|\n| a\\|b | 12,345 | 12.3 |\n| c | - | - |\n| d | - | - |\n"
    )


def test_csv_keeps_full_precision() -> None:
    rows = list(csv.DictReader(io.StringIO(TABLE.csv())))
    assert rows[0] == {"name": "a|b", "excess": "12345", "cut": "12.34"}
    assert rows[2] == {"name": "d", "excess": "", "cut": ""}


def test_text_is_aligned() -> None:
    assert TABLE.text() == "name  excess  cut %\na|b   12,345   12.3\nc          -      -\nd          -      -\n"
