"""The context that tests share: what nothing refers to any more is freed, and nothing else."""

import ctypes

import moderngl
import pytest

from tests import shared_context
from tests.shared_context import SharedPrograms, free_unreachable, is_shared
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ShaderLibrary
from viewer.locations import shaders_folder
from viewer.render.resources.layout import scene_includes

pytestmark = pytest.mark.once
FULL_SCREEN = ("common/fullscreen.vert", "passes/accumulate/accumulate.frag")


@pytest.fixture
def shared(graphics: GraphicsContext) -> GraphicsContext:
    if not is_shared(graphics.gl):
        pytest.skip("draws on a device of its own")
    return graphics


def exists(graphics: GraphicsContext, kind: str, name: int) -> bool:
    """Whether OpenGL has a texture, buffer or program of that name."""
    ask = ctypes.CFUNCTYPE(ctypes.c_ubyte, ctypes.c_uint)(graphics.load(f"glIs{kind}"))
    return bool(ask(name))


def test_what_nothing_refers_to_is_freed_and_the_rest_stays(shared: GraphicsContext) -> None:
    held = shared.memory.texture("held", (4, 4), 4)
    # Counting what is read back refers from an object to itself.
    left = [shared.memory.texture("left", (4, 4), 4).glo, shared.memory.buffer("left", reserve=4).glo]
    assert exists(shared, "Texture", left[0])
    free_unreachable()
    assert exists(shared, "Texture", held.glo)
    assert not exists(shared, "Texture", left[0])
    assert not exists(shared, "Buffer", left[1])
    held.release()


def test_programs_are_kept_until_there_are_too_many(shared: GraphicsContext, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_context, "_MADE", {})

    def program() -> moderngl.Program:
        return SharedPrograms(shared.gl, ShaderLibrary(shaders_folder(), scene_includes())).program(*FULL_SCREEN)

    kept = program().glo
    free_unreachable()
    assert exists(shared, "Program", kept)
    assert program().glo == kept
    held = program()
    monkeypatch.setattr(shared_context, "MOST_PROGRAMS", 0)
    free_unreachable()
    assert exists(shared, "Program", held.glo), "somebody holds it"
    del held
    free_unreachable()
    assert not exists(shared, "Program", kept)
