"""Perceptual measures: equal pictures are perfect, and more error is worse."""

from collections.abc import Callable

import numpy as np
import pytest

from ntc.errors import InputError
from ntc.metrics import perceptual


def pictures() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A smooth picture [64, 96, 3] uint8, and the same with a little and with much noise."""
    random = np.random.default_rng(3)
    y, x = np.mgrid[0:64, 0:96]
    smooth = np.stack([np.sin(x * 0.1 * (number + 1)) * np.cos(y * 0.07) * 90 + 128 for number in range(3)], axis=2)
    noise = random.normal(size=smooth.shape)
    little, much = (np.clip(smooth + noise * strength, 0, 255).astype(np.uint8) for strength in (2.0, 12.0))
    return smooth.astype(np.uint8), little, much


@pytest.mark.parametrize(
    ("measure", "is_there", "perfect"),
    [
        (perceptual.ssimulacra2, perceptual.has_ssimulacra2, 100.0),
        (perceptual.jod, perceptual.has_jod, 10.0),
    ],
)
def test_more_error_is_worse(
    measure: Callable[[np.ndarray, np.ndarray], float], is_there: Callable[[], bool], perfect: float
) -> None:
    if not is_there():
        pytest.skip("its package is not installed (extra perceptual)")
    smooth, little, much = pictures()
    assert measure(smooth, smooth) == pytest.approx(perfect, abs=1e-3)
    assert perfect > measure(smooth, little) > measure(smooth, much)


def test_a_missing_package_is_said_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "ssimulacra2", None)
    with pytest.raises(InputError, match=r"SSIMULACRA2: .*pip install 'ntc-viewer\[perceptual\]'"):
        perceptual.ssimulacra2(*pictures()[:2])
