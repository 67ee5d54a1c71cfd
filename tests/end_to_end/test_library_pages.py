"""The notebook docs/guide/library.ipynb runs, and shows the pictures that it was committed with."""

from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
NOTEBOOK = DOCS / "guide" / "library.ipynb"
LARGEST_BYTES = 400_000
PICTURES = 3


@pytest.mark.process
@pytest.mark.gl
@pytest.mark.guards("notebook")
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
