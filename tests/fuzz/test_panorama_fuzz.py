"""Damaged files of panoramas give a panorama or InputError: never another exception, never for long."""

import random
import time
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
import pytest

from ntc.errors import InputError
from tests.support.work import limited
from viewer.lighting.panorama import LARGEST_RADIANCE, load_panorama

SECONDS = 1.5
"""How long each of these tests may run; it stops there, with whatever number of files."""
CASES = 600
MOST_UNITS = 60.0
"""Work that one file may take."""


@pytest.fixture(scope="module", params=["hdr", "exr"])
def good(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, bytes]:
    """(suffix, a small well-formed file)."""
    path = tmp_path_factory.mktemp("good") / f"good.{request.param}"
    pixels = np.random.default_rng(0).gamma(0.5, 2.0, (16, 32, 3)).astype(np.float32)
    output: Any = OpenImageIO.ImageOutput.create(str(path))
    assert output.open(str(path), OpenImageIO.ImageSpec(32, 16, 3, "float"))
    assert output.write_image(pixels)
    output.close()
    return request.param, path.read_bytes()


def damaged(data: bytes, source: random.Random) -> bytes:
    """`data` with bytes changed, cut out, doubled, or an end cut off; headers more often than pixels."""
    result = bytearray(data)
    for _ in range(source.randint(1, 6)):
        place = source.randrange(min(len(result), source.choice([64, 400, len(result)])))
        kind = source.randrange(4)
        if kind == 0:
            result[place] = source.randrange(256)
        elif kind == 1:
            del result[place : place + source.randint(1, 8)]
        elif kind == 2:
            result[place:place] = result[place : place + source.randint(1, 8)]
        else:
            result[place : place + 4] = source.choice([0, 1, 2**31 - 1, 2**32 - 1, 8192, 1 << 20]).to_bytes(4, "little")
        if len(result) < 16:
            break
    return bytes(result[: source.randrange(len(result))] if source.random() < 0.1 else result)


def refusal(path: Path) -> str | None:
    """Why the file is no panorama; None where it is a whole one."""
    try:
        pixels = load_panorama(path).pixels
    except InputError as error:
        return str(error)
    assert pixels.shape[1] == 2 * pixels.shape[0]
    assert np.isfinite(pixels).all()
    assert pixels.min() >= 0.0
    assert pixels.max() <= LARGEST_RADIANCE
    return None


def test_damaged_files_are_panoramas_or_one_line(good: tuple[str, bytes], tmp_path: Path) -> None:
    suffix, data = good
    source, until, refused = random.Random(7), time.monotonic() + SECONDS, 0
    path = tmp_path / f"damaged.{suffix}"
    for _ in range(CASES):
        path.write_bytes(damaged(data, source))
        with limited(MOST_UNITS):
            message = refusal(path)
        refused += message is not None
        assert message is None or message.startswith(str(path))
        assert message is None or "\n" not in message
        if time.monotonic() > until:
            break
    assert refused > 0
