"""What of OpenGL is used beyond 4.3's minimum, and how to do without it."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import moderngl

from ntc.errors import InputError
from viewer.gl.half_arithmetic import half_arithmetic

WITHOUT_VARIABLE: Final = "NTC_VIEWER_WITHOUT"
"""Environment variable: names of NAMES, separated by commas, that are not to be used although the driver has them."""
NAMES: Final = ("timer-queries", "uniform-decoders", "weights-in-image", "half-arithmetic", "anisotropy")


@dataclass(frozen=True)
class Features:
    """What is used of a driver. Every picture is the same without any of it, but for anisotropic filtering and half arithmetic."""

    timer_queries: bool
    """Times by the GPU's own clock, else wall time around `finish()`."""
    uniform_block_bytes: int
    """Largest decoder that is bound as a uniform buffer; larger ones are read from a storage buffer."""
    weights_in_image: bool
    """Weights of decoders lie in an image, which software renderers fetch from several times faster than from buffers."""
    half_arithmetic: str | None
    """GLSL extension for arithmetic in halves; None: precisions that need it are refused."""
    anisotropy: int
    """Most that the driver's filter does; 1: none."""


def features_without(names: str) -> frozenset[str]:
    """What WITHOUT_VARIABLE names. Raises InputError."""
    given = frozenset(name.strip() for name in names.split(",") if name.strip())
    for name in sorted(given - set(NAMES)):
        raise InputError(f"{WITHOUT_VARIABLE}: {name!r} is none of {', '.join(NAMES)}")
    return given


def find_features(gl: moderngl.Context, is_software: bool, environment: Mapping[str, str] = os.environ) -> Features:
    """What is used of this driver. Raises InputError for an environment that names something unknown."""
    without = features_without(environment.get(WITHOUT_VARIABLE, ""))
    # llvmpipe's timer queries return nonsense.
    return Features(
        timer_queries="timer-queries" not in without and not is_software,
        uniform_block_bytes=0 if "uniform-decoders" in without else int(gl.info["GL_MAX_UNIFORM_BLOCK_SIZE"]),
        weights_in_image="weights-in-image" not in without and is_software,
        half_arithmetic=None if "half-arithmetic" in without else half_arithmetic(gl),
        anisotropy=1 if "anisotropy" in without else max(1, int(gl.max_anisotropy)),
    )
