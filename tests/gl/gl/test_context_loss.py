"""What the driver says of its resets is understood, and nothing that a lost context drew comes out of a renderer."""

import ctypes
from collections.abc import Callable, Mapping
from dataclasses import replace

import moderngl
import pytest

from ntc.errors import InputError
from tests.gl.small_scenes import FRONT, objects
from viewer.gl.context import GraphicsContext
from viewer.gl.context_loss import GL_CONTEXT_LOST, LOSE_VARIABLE, ContextLostError, ResetStatus, SimulatedLosses
from viewer.render.renderer import Renderer
from viewer.state.view_state import Slot, ViewState

GUILTY, INNOCENT, UNKNOWN = 0x8253, 0x8254, 0x8255
CALL = ctypes.CFUNCTYPE(ctypes.c_uint)
CALLED_BY_ADDRESS: list[object] = []
"""A driver's functions stay where they are."""


class Driver:
    """Addresses of functions that return what is asked for."""

    def __init__(self, **functions: Callable[[], int]) -> None:
        self._functions = {name: CALL(function) for name, function in functions.items()}
        CALLED_BY_ADDRESS.extend(self._functions.values())

    def __call__(self, name: str) -> int:
        function = self._functions.get(name)
        return 0 if function is None else ctypes.cast(function, ctypes.c_void_p).value or 0


@pytest.mark.parametrize("name", ["glGetGraphicsResetStatus", "glGetGraphicsResetStatusARB"])
@pytest.mark.parametrize(
    ("status", "blame", "words"),
    [
        (GUILTY, "guilty", "this program"),
        (INNOCENT, "innocent", "another program"),
        (UNKNOWN, "unknown", "not known"),
        (0x92BB, "unknown", "not known"),
    ],
)
def test_each_status_says_who_was_the_cause(name: str, status: int, blame: str, words: str) -> None:
    reset = ResetStatus(Driver(**{name: lambda: status}))
    assert reset.is_supported
    with pytest.raises(ContextLostError, match=words) as caught:
        reset.check()
    assert caught.value.blame == blame
    assert "\n" not in str(caught.value)


def test_a_loss_that_is_said_once_stays() -> None:
    said = iter([0, INNOCENT, 0, 0])
    driver = Driver(glGetGraphicsResetStatus=lambda: next(said))
    reset = ResetStatus(driver)
    reset.check()
    for _ in range(3):
        with pytest.raises(ContextLostError, match="another program"):
            reset.check()


def test_a_reset_is_waited_for_and_not_for_ever() -> None:
    said = iter([GUILTY, GUILTY, 0])
    assert ResetStatus(Driver(glGetGraphicsResetStatus=lambda: next(said))).wait_until_over(5.0)
    assert not ResetStatus(Driver(glGetGraphicsResetStatus=lambda: GUILTY)).wait_until_over(0.05)


def test_errors_of_a_lost_context_are_told_as_its_loss() -> None:
    lost = ResetStatus(Driver(glGetGraphicsResetStatus=lambda: GUILTY))
    only_error = ResetStatus(Driver(glGetError=lambda: GL_CONTEXT_LOST))
    for reset in (lost, only_error):
        with pytest.raises(ContextLostError) as caught, reset.watched():
            raise moderngl.Error("cannot map the buffer")
        assert isinstance(caught.value.__cause__, moderngl.Error)
    whole = ResetStatus(Driver(glGetGraphicsResetStatus=lambda: 0, glGetError=lambda: 0x0502))
    with pytest.raises(moderngl.Error), whole.watched():
        raise moderngl.Error("the framebuffer is not complete")


@pytest.mark.parametrize("text", ["x", "-1", "1;2", "1.5", "٣", "9" * 20])
def test_the_environment_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(InputError, match=LOSE_VARIABLE):
        SimulatedLosses.of_environment({LOSE_VARIABLE: text})


def test_simulated_losses_count_on_over_contexts() -> None:
    environment: Mapping[str, str] = {LOSE_VARIABLE: " 2, 4,"}
    losses = SimulatedLosses.of_environment(environment)
    for _ in range(2):
        reset = ResetStatus(Driver(glGetGraphicsResetStatus=lambda: 0), losses)
        reset.check()
        with pytest.raises(ContextLostError, match="not known"):
            reset.check()
    assert not SimulatedLosses.of_environment({}).next_is_lost()


def test_a_renderer_returns_nothing_that_a_lost_context_drew(graphics: GraphicsContext) -> None:
    view = ViewState(FRONT, (60, 36))
    renderer = Renderer(replace(graphics, reset=ResetStatus(Driver(), SimulatedLosses(frozenset({2})))), objects())
    renderer.render(view)
    for draw in (
        lambda: renderer.picture(Slot()),
        renderer.texture_ids,
        renderer.covered,
        lambda: renderer.render(view),
        lambda: renderer.texture_ids_from(FRONT, (8, 8)),
    ):
        with pytest.raises(ContextLostError):
            draw()
    renderer.release()
