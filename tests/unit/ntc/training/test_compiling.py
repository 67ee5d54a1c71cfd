"""Compiling an encoder ahead: what progress says meanwhile, the types that encoders need, and where compiled code is kept."""

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numba import config, int64

from ntc.api import encode, material
from ntc.codec import mips
from ntc.codec.codec import Codec
from ntc.codec.compiling import compiled_loop
from ntc.codec.encoding import QualityTarget
from ntc.codec.maps import MapName
from ntc.codec.registry import codec_named
from ntc.errors import TrainingCancelledError
from ntc.training.compiling import COMPILING, CompilingAhead
from ntc.training.messages import TrainingProgress

LOOP = """
from ntc.codec.compiling import compiled_loop

@compiled_loop()
def successor(x):
    return x + 1
"""


def codec_of(functions: Mapping[Any, tuple[Any, ...]]) -> Codec:
    return cast(Codec, SimpleNamespace(compiled_functions=lambda: functions))


@pytest.fixture(autouse=True)
def _empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Loops of these tests are compiled again in each run of the tests."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "numba"))


def slow_loop(place: int) -> Any:
    """A loop that takes a while to compile."""

    @compiled_loop()
    def loop(values: Any) -> Any:
        total = np.zeros(3)
        for value in range(values):
            total += np.sort(np.array([value, place, values]))[:3]
        return total.sum()

    return loop


def test_progress_says_that_the_encoder_is_compiled_while_it_is() -> None:
    loop, reports = slow_loop(1), list[TrainingProgress]()
    with CompilingAhead(codec_of({loop: (int64,)})) as compiling:
        compiling.wait(reports.append, lambda: None)
        assert not compiling.is_compiling
        assert compiling.wait_loaded()
    assert {(report.work, report.steps, report.share) for report in reports} == {(COMPILING, 0, 0.0)}
    assert loop.signatures == [(int64,)]
    reports.clear()
    with CompilingAhead(codec_of({loop: (int64,)})) as compiling:
        compiling.wait(reports.append, lambda: None)
    assert not reports


def test_a_wait_can_be_interrupted_and_leaving_ends_the_work() -> None:
    loops = [slow_loop(place) for place in range(20)]

    def interrupt(_progress: TrainingProgress) -> None:
        raise TrainingCancelledError

    with pytest.raises(TrainingCancelledError), CompilingAhead(codec_of(dict.fromkeys(loops, (int64,)))) as compiling:
        compiling.wait(interrupt, lambda: None)
    assert not loops[-1].signatures


def test_loops_that_do_not_compile_are_left_to_the_encoding() -> None:
    with CompilingAhead(codec_of({slow_loop(2): (int64, int64)})) as compiling:
        compiling.wait(lambda _: None, lambda: None)
    with CompilingAhead(codec_named("grid")) as compiling:
        assert compiling.wait_loaded()


def test_encoders_call_loops_with_the_types_that_are_compiled_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    # Textures as small as these would do without the compiled loops for maps.
    monkeypatch.setattr(mips, "LEAST_COMPILED", 1 << 18)
    functions = codec_named("block").compiled_functions()
    # Arrays that lie otherwise, which other tests encode.
    before = {function: set(function.signatures) for function in functions}
    random = np.random.default_rng(0)
    channels: dict[MapName, int] = {"base": 3, "normal": 2, "roughness": 1, "emissive": 3, "alpha": 1}
    for side, names, target in (
        (16, ("base",), None),
        (16, ("base", "alpha"), None),
        (384, ("base", "normal", "roughness"), None),
        (64, tuple(channels), QualityTarget(30.0)),
    ):
        maps = {own: random.integers(0, 256, (side, side, channels[own]), np.uint8) for own in channels if own in names}
        encode([material(maps, cutoff=0.5 if "alpha" in names else None)], target=target)
    for function, types in functions.items():
        assert set(function.signatures) - before[function] <= {types}
        assert types in function.signatures


@pytest.mark.process
@pytest.mark.parametrize("cache", ["user's", "none"])
def test_without_a_folder_beside_the_code_loops_are_kept_in_the_users_cache_or_not_at_all(
    cache: str, tmp_path: Path
) -> None:
    (tmp_path / "loop.py").write_text(LOOP, encoding="utf-8")
    # A file where the folder would be: as if it could not be written.
    (tmp_path / "__pycache__").touch()
    users = tmp_path / "users"
    if cache == "none":
        users.touch()
    path = os.pathsep.join([str(tmp_path), *sys.path])
    environment = {**os.environ, "PYTHONPATH": path, "XDG_CACHE_HOME": str(users), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("NUMBA_CACHE_DIR", None)
    command = [sys.executable, "-c", "import loop; print(loop.successor(1))"]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert result.stdout == "2\n"
    assert len(list(users.rglob("*.nbi"))) == (cache != "none")
