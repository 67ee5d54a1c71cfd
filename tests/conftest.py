"""Fixtures and markers shared by all tests."""

import os
from collections.abc import Generator
from contextlib import ExitStack
from pathlib import Path

import pytest

# Before numpy and torch are imported: tests run side by side, and threads of one that wait for another's core spin.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("LP_NUM_THREADS", "1")

from tests.changes import changed_paths, has_to_run
from tests.drivers.messages import own_session_folders
from tests.shared_context import free_unreachable, share
from tests.support.checked_indices import checked_indices
from tests.support.process_memory import MOST_GROWTH, MOST_MEGABYTES, excess, megabytes, trim

# Before other conftest.py files import what makes contexts: pytest reads those of folders that it is given first of all.
share()

TESTS = Path(__file__).parent
DRAWING = ("drivers", "gl", "golden", "ui")
"""Folders whose tests all draw with OpenGL."""
AT_START = pytest.StashKey[int]()
"""Megabytes of this process before its first test: what imports take, which depends on the build of torch."""
LEAST_MEMORY = pytest.StashKey[int]()
"""Megabytes of this process when it was last freed of what tests have left."""
HAS_EXCESS = pytest.StashKey[bool]()
"""True once a test has failed for the memory of this process."""


def pytest_configure(config: pytest.Config) -> None:
    """Have session folders before anything is drawn in this process or in one that it starts, and check indices where that is asked
    for."""
    stack = ExitStack()
    stack.enter_context(checked_indices(config))
    stack.enter_context(own_session_folders())
    config.add_cleanup(stack.close)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that `tests/run` gives."""
    parser.addoption("--changed", action="store_true", help="leave out tests that guard nothing that has changed")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what folders have in common, and leave out what guards nothing that has changed."""
    if config.getoption("--changed"):
        left_out = [item for item in items if guards_in_vain(item)]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in set(left_out)]
    for item in items:
        folder = item.path.relative_to(TESTS).parts[0]
        if folder in DRAWING:
            item.add_marker(pytest.mark.gl)
        if folder == "end_to_end":
            item.add_marker(pytest.mark.slow)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Note what the process has before its first test."""
    session.config.stash[AT_START] = megabytes()


def guards_in_vain(item: pytest.Item) -> bool:
    """Return whether neither the test nor the paths that its sets guard have changed."""
    names, changed = [mark.args[0] for mark in item.iter_markers("guards")], changed_paths()
    file = item.path.relative_to(TESTS.parent).as_posix()
    is_new = changed is None or file in changed
    return bool(names) and not is_new and not any(has_to_run(name, changed) for name in names)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Generator[None, None, None]:
    """Free what the tests of a file have left, and fail the first test that leaves the process with too much memory."""
    yield
    stash, is_last = item.config.stash, nextitem is None or nextitem.path != item.path
    if stash.get(HAS_EXCESS, False):
        return
    most = stash.get(AT_START, 0) + MOST_MEGABYTES
    if excess(most) or (is_last and not 0 < megabytes() < stash.get(LEAST_MEMORY, 0) + MOST_GROWTH):
        free_unreachable()
        trim()
        stash[LEAST_MEMORY] = megabytes()
    message = excess(most)
    if message:
        stash[HAS_EXCESS] = True
        pytest.fail(message, pytrace=False)


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """Folder of real scenes and textures for development; tests that need it skip where it is absent."""
    given = os.environ.get("NTC_VIEWER_DATA")
    folder = Path(given) if given else TESTS.resolve().parents[1] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no development data at {folder}; set NTC_VIEWER_DATA to a folder with scenes/ and textures/")
    return folder


@pytest.fixture(scope="session", autouse=True)
def temporary_cache_folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Set folders of a temporary cache and data, so that tests neither read nor fill the user's."""
    os.environ["NTC_VIEWER_DATA_DIR"] = str(tmp_path_factory.mktemp("data"))
    os.environ["NTC_VIEWER_CACHE_DIR"] = str(tmp_path_factory.mktemp("cache"))
