"""The OpenGL context that all tests of this folder draw with."""

from collections.abc import Iterator

import pytest

from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.render.path_choice import COMPUTING
from viewer.state.view_state import Slot

CONTEXT = pytest.StashKey[GraphicsContext]()
NEEDS_COMPUTE = "needs compute shaders: OpenGL 4.3"


def _context(config: pytest.Config) -> GraphicsContext:
    """One context without a window for the whole run."""
    if CONTEXT not in config.stash:
        config.stash[CONTEXT] = create_headless_context()
    return config.stash[CONTEXT]


def _computes(item: pytest.Item) -> bool:
    """Whether a test is marked `computes`, or is of a decode path that does: elsewhere that one is drawn by another."""
    given = item.callspec.params.values() if isinstance(item, pytest.Function) and hasattr(item, "callspec") else ()
    paths = [value.path if isinstance(value, Slot) else value for value in given]
    return item.get_closest_marker("computes") is not None or any(
        isinstance(path, str) and path in COMPUTING for path in paths
    )


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Before fixtures draw anything: skip what computes where nothing does, and draw in the run's own context.

    Tests may make others, which are current from then on: names of this one mean others there.
    """
    context = _context(item.config)
    if _computes(item) and not context.features.compute:
        pytest.skip(NEEDS_COMPUTE)
    context.gl.__enter__()


@pytest.fixture(scope="session")
def graphics(pytestconfig: pytest.Config) -> Iterator[GraphicsContext]:
    """The context of the run."""
    context = _context(pytestconfig)
    yield context
    del pytestconfig.stash[CONTEXT]
    context.gl.release()
