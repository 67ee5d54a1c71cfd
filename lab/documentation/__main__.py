"""Generator of README and docs: `python -m lab.documentation` writes the generated parts again and prints the changed pages.

A generated part is between `<!-- NAME -->` and `<!-- end of NAME -->`. Text outside the marks is written by hand.
"""

import re
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from lab.documentation.api_page import api_page
from lab.documentation.command_tables import command_table, key_table
from lab.documentation.option_tables import option_tables, settings_table
from lab.documentation.report_tables import REPORT_PARTS
from ntc.io import write_text
from viewer.script.directions import direction_table_markdown

ROOT = Path(__file__).resolve().parents[2]
PARTS: Mapping[str, Callable[[], str]] = {
    "api": api_page,
    "commands": command_table,
    "directions": direction_table_markdown,
    "keys": key_table,
    "options": option_tables,
    "settings": settings_table,
    **REPORT_PARTS,
}
"""Generated parts by the name in their marks."""


def pages() -> Iterator[Path]:
    """Yield README, CONTRIBUTING and all pages of docs in order."""
    yield from (ROOT / "README.md", ROOT / "CONTRIBUTING.md")
    yield from sorted((ROOT / "docs").rglob("*.md"))


def generated(text: str) -> str:
    """Return the `text` of a page with all generated parts written again. Raises KeyError for an unknown mark."""

    def part(match: re.Match[str]) -> str:
        name = match[1]
        return f"<!-- {name} -->\n\n{PARTS[name]().strip()}\n\n<!-- end of {name} -->"

    return re.sub(r"<!-- ([\w: ./-]+) -->\n.*?<!-- end of \1 -->", part, text, flags=re.DOTALL)


def main() -> None:
    """Write all pages, and print the names of those that changed."""
    for page in pages():
        old = page.read_text(encoding="utf-8")
        new = generated(old)
        if new != old:
            write_text(page, new)
            sys.stdout.write(f"{page.relative_to(ROOT)}\n")


if __name__ == "__main__":
    main()
