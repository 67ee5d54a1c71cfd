"""The library's pages: docs/api.md says what the docstrings say, and docs/library.ipynb runs as it stands."""

from pathlib import Path

import pytest

import ntc
from lab.documentation.api_page import api_page

DOCS = Path(__file__).resolve().parents[2] / "docs"
NOTEBOOK = DOCS / "library.ipynb"
LARGEST_BYTES = 400_000
PICTURES = 3


def test_the_page_is_that_of_the_docstrings() -> None:
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    assert page == api_page(), "run: python -m lab.documentation.api_page docs/api.md"
    for name in ntc.__all__:
        assert f"### `{name}`\n" in page


@pytest.mark.process
@pytest.mark.gl
def test_the_notebook_runs() -> None:
    nbformat = pytest.importorskip("nbformat", reason="pip install nbclient")
    nbclient = pytest.importorskip("nbclient", reason="pip install nbclient")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    committed = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert sum("image/png" in output.get("data", {}) for output in committed) == PICTURES
    assert NOTEBOOK.stat().st_size < LARGEST_BYTES
    done = nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    shown = [output for cell in done.cells for output in cell.get("outputs", [])]
    assert sum("image/png" in output.get("data", {}) for output in shown) == PICTURES
