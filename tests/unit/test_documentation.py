"""README and docs: generated parts are those of the code, and links and paths lead somewhere."""

import pytest

import ntc
from lab.documentation.__main__ import ROOT, generated, pages

PAGES = list(pages())


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_generated_parts_are_up_to_date(page: object) -> None:
    text = page.read_text(encoding="utf-8")  # type: ignore[attr-defined]
    assert generated(text) == text, "run: python -m lab.documentation"


def test_the_api_page_has_every_name() -> None:
    page = (ROOT / "docs/reference/api.md").read_text(encoding="utf-8")
    assert [name for name in ntc.__all__ if f"### `{name}`\n" not in page] == []
