"""Without any optional feature of the driver the pictures stay the same; without what is needed there is one clear line."""

import os
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ntc.errors import InputError
from tests.drivers.messages import error_line
from tests.gl.small_scenes import FRONT, objects, pack_of
from viewer.gl.context import GraphicsContext
from viewer.gl.features import NAMES, WITHOUT_VARIABLE, features_without, find_features
from viewer.gl.timer import PassTimer
from viewer.render.renderer import Renderer
from viewer.state.view_state import EXACT_PATHS, Slot, ViewState

SIZE = (60, 36)


def pictures(context: GraphicsContext) -> dict[str, Any]:
    """Linear albedo of every path, and of the reference with anisotropy."""
    scene = objects()
    renderer = Renderer(context, scene)
    # One decoder, so that the shared variant of deferred is drawn too.
    packs = {
        "two": pack_of(scene),
        "one": pack_of(scene, groups=(0, 0, 0, 0)),
    }
    renderer.set_packs(packs)
    found = {}
    for source in packs:
        for path in EXACT_PATHS:
            slot = Slot(source, path)
            renderer.render(ViewState(FRONT, SIZE, slot))
            found[f"{source} {path}"] = renderer.picture(slot)
    renderer.release()
    return found


@pytest.fixture(scope="module")
def expected(graphics: GraphicsContext) -> dict[str, Any]:
    """With all that the driver has."""
    return pictures(graphics)


@pytest.mark.once
@pytest.mark.parametrize("name", [*NAMES, "uniform-decoders,weights-in-image"])
def test_each_optional_feature_can_be_missing(graphics: GraphicsContext, expected: dict[str, Any], name: str) -> None:
    without = find_features(graphics.gl, graphics.info.is_software, {WITHOUT_VARIABLE: name})
    reduced = replace(graphics, features=without)
    assert PassTimer(reduced).kind == "wall time around finish" or name != "timer-queries"
    for key, picture in pictures(reduced).items():
        drawn = key.replace("cached", "forward") if name == "compute" else key
        np.testing.assert_allclose(picture, expected[drawn], atol=1e-6, err_msg=key)


def test_a_name_that_is_not_known_is_one_line() -> None:
    assert features_without(" anisotropy, ,half-arithmetic") == {"anisotropy", "half-arithmetic"}
    with pytest.raises(InputError, match=r"'shaders' is none of compute, .*anisotropy"):
        features_without("anisotropy,shaders")


def run(**environment: str) -> subprocess.CompletedProcess[str]:
    """`ntc-viewer doctor`-like start of a context in a process of its own."""
    code = (
        "import sys; from ntc.errors import InputError; from viewer.gl.context import create_headless_context\n"
        "try:\n    create_headless_context()\n"
        "except InputError as error:\n    sys.exit(f'error: {error}')\n"
    )
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@pytest.mark.parametrize(
    ("environment", "parts"),
    [
        ({"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent"}, ("4.1 without a window is not available", "apt-get")),
    ],
    ids=["no driver"],
)
def test_what_is_needed_and_missing_is_one_line(environment: dict[str, str], parts: tuple[str, ...]) -> None:
    ran = run(**environment)
    if ran.returncode == 0:
        pytest.skip("this driver does not follow the override")
    line = error_line(ran.stderr)
    for part in parts:
        assert part in line
