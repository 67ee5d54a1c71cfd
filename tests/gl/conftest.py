"""The OpenGL context that all tests of this folder draw with."""

from collections.abc import Iterator

import pytest

from viewer.gl.context import GraphicsContext, create_headless_context


@pytest.fixture(scope="session")
def graphics() -> Iterator[GraphicsContext]:
    """One context without a window for the whole run."""
    context = create_headless_context()
    yield context
    context.gl.release()
