"""The OpenGL context that all tests of this folder draw with."""

from collections.abc import Iterator

import pytest

from tests.support.every_program import AssembledProgram, every_program
from viewer.gl.context import GraphicsContext, create_headless_context


@pytest.fixture(scope="session")
def graphics() -> Iterator[GraphicsContext]:
    """One context without a window for the whole run."""
    context = create_headless_context()
    yield context
    context.gl.release()


@pytest.fixture(autouse=True)
def _stays_current(graphics: GraphicsContext) -> Iterator[None]:
    """Tests may make contexts of their own, which are current from then on: names of this one mean others there."""
    yield
    graphics.gl.__enter__()


@pytest.fixture(scope="session")
def programs(graphics: GraphicsContext) -> tuple[AssembledProgram, ...]:
    """Every program that can be assembled; collecting them takes about 20 s."""
    return every_program(graphics)
