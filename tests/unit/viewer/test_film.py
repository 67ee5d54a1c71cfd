"""Films of the window: what is taken, how long it is shown, and how much is held in memory."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from viewer.capture import film as module
from viewer.capture.film import LAST_PICTURE_SECONDS, Film

PICTURES = [np.full((16, 24, 3), shade, np.uint8) for shade in (10, 90, 170, 250)]


def test_each_picture_is_shown_as_long_as_it_stood(tmp_path: Path) -> None:
    film = Film(tmp_path / "a.webp")
    assert film.write() == 0
    for picture, now in zip(PICTURES, (10.0, 10.5, 12.0, 12.25), strict=True):
        assert film.wants(now)
        film.add(picture, now)
        assert not film.wants(now + 0.05)
    # The same again, and another size, are left out.
    film.add(PICTURES[3], 13.0)
    film.add(PICTURES[0][:8], 14.0)
    assert film.write() == 4
    shown = []
    with Image.open(film.path) as read:
        for number, expected in enumerate(PICTURES):
            read.seek(number)
            assert np.asarray(read.convert("RGB")).mean() == pytest.approx(expected.mean(), abs=3.0)
            shown.append(read.info["duration"])
    assert shown == [500, 1500, 250, round(1000 * LAST_PICTURE_SECONDS)]


def test_of_a_long_film_every_second_picture_goes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LARGEST_FILM", 3 * PICTURES[0].nbytes)
    film = Film(tmp_path / "a.webp")
    for now in range(9):
        film.add(PICTURES[now % 2], float(now))
        assert len(film._pictures) <= 3
    assert film.write() <= 3
