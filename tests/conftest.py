"""Fixtures shared by all tests."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """Folder of real scenes and textures for development; tests that need it skip where it is absent."""
    given = os.environ.get("NTC_VIEWER_DATA")
    folder = Path(given) if given else Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no development data at {folder}; set NTC_VIEWER_DATA to a folder with scenes/ and textures/")
    return folder


@pytest.fixture(scope="session", autouse=True)
def own_cache_folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Tests neither read nor fill the user's cache."""
    os.environ["NTC_VIEWER_CACHE_DIR"] = str(tmp_path_factory.mktemp("cache"))
