"""The mean of samples, added one after the other."""

import numpy as np
import pytest
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext
from viewer.render.resources.accumulator import SAMPLES, Accumulator
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.pack_buffers import scene_programs

pytestmark = [pytest.mark.gl, pytest.mark.driver]
SIZE = (7, 5)


def samples() -> NDArray[np.float32]:
    """[SAMPLES, 5, 7, 4] float32 of any alpha, some far above 1 and some negative."""
    random = np.random.default_rng(4)
    values = random.random((SAMPLES, *SIZE[::-1], 4)) * 10.0 ** random.integers(-3, 4, (*SIZE[::-1], 4))
    return (values * random.choice((-1.0, 1.0), values.shape)).astype(np.float32)


def drawn(graphics: GraphicsContext, at_once: bool) -> NDArray[np.float32]:
    """Mean of `samples` [5, 7, 4]; all drawn `at_once`, or each finished before the next one begins."""
    accumulate, mean = Accumulator(graphics, scene_programs(graphics)), ColorTarget(graphics, SIZE)
    for number, sample in enumerate(samples()):
        (accumulate.sample(SIZE) if number else mean).texture.write(sample.tobytes())
        if number:
            accumulate.run(number, mean)
        if not at_once:
            graphics.gl.finish()
    found = np.frombuffer(mean.texture.read(), np.float32).reshape(*SIZE[::-1], 4)
    accumulate.release()
    mean.release()
    return found


@pytest.mark.parametrize("at_once", [False, True])
def test_samples_become_their_mean_however_many_are_drawn_at_once(graphics: GraphicsContext, at_once: bool) -> None:
    largest = np.abs(samples()).max(0)
    off = np.abs(drawn(graphics, at_once) - samples().mean(0, dtype=np.float64))
    assert (off / largest).max() <= 2e-6
