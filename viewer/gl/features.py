"""Optional features of OpenGL beyond 4.3's minimum: which the driver has, and which the environment switches off."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import moderngl

from ntc.errors import InputError

COMPUTE_VERSION: Final = 430
"""OpenGL 4.3: for all that is there."""
DRAWING_VERSION: Final = 410
"""OpenGL 4.1, where macOS ends: for what is drawn without computing."""
WITHOUT_VARIABLE: Final = "NTC_VIEWER_WITHOUT"
"""Environment variable: names of NAMES, separated by commas, that are not used although the driver has them."""
NAMES: Final = ("compute", "timer-queries", "uniform-decoders", "weights-in-image", "half-arithmetic", "anisotropy")
HALF_EXTENSIONS: Final = (
    "GL_NV_gpu_shader5",
    "GL_AMD_gpu_shader_half_float",
    "GL_EXT_shader_explicit_arithmetic_types_float16",
)
"""GLSL extensions with the types `float16_t` and `f16vec4`, the most common first."""
_HALF_PROBE: Final = """#version 430
#extension {extension} : require
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Values {{ vec4 values[]; }};
void main() {{
    f16vec4 factors = f16vec4(values[0]);
    float16_t sum = factors.x * factors.y + float16_t(0.5);
    values[1] = vec4(max(factors, sum * factors));
}}
"""


@dataclass(frozen=True)
class Features:
    """Optional features in use. Pictures do not depend on them, but for anisotropic filtering and half arithmetic."""

    compute: bool
    """OpenGL 4.3: shaders that compute, storage buffers. False: OpenGL 4.1 at least, with paths `forward` and `cached`."""
    timer_queries: bool
    """Times by the GPU's own clock, else wall time around `finish()`."""
    uniform_block_bytes: int
    """Largest decoder that is bound as a uniform buffer; larger ones are read from a storage buffer."""
    weights_in_image: bool
    """Keep the weights of decoders in an image, which software renderers fetch from several times faster than from buffers."""
    half_arithmetic: str | None
    """GLSL extension for half-precision arithmetic; None: precisions that need it are refused."""
    anisotropy: int
    """Largest anisotropy of the driver's filter; 1: none."""


def features_without(names: str) -> frozenset[str]:
    """The features that WITHOUT_VARIABLE names. Raises InputError for a name that is not in NAMES."""
    given = frozenset(name.strip() for name in names.split(",") if name.strip())
    for name in sorted(given - set(NAMES)):
        raise InputError(f"{WITHOUT_VARIABLE}: {name!r} is none of {', '.join(NAMES)}")
    return given


def half_arithmetic(gl: moderngl.Context) -> str | None:
    """The first of HALF_EXTENSIONS with which the driver compiles a shader that computes in halves; None where there is none."""
    for extension in HALF_EXTENSIONS:
        try:
            gl.compute_shader(_HALF_PROBE.format(extension=extension)).release()
        except moderngl.Error:
            continue
        return extension
    return None


def find_features(gl: moderngl.Context, is_software: bool, environment: Mapping[str, str] = os.environ) -> Features:
    """The features to use with this driver. Raises InputError where WITHOUT_VARIABLE names an unknown one."""
    without = features_without(environment.get(WITHOUT_VARIABLE, ""))
    # llvmpipe's timer queries return nonsense.
    compute = "compute" not in without and gl.version_code >= COMPUTE_VERSION
    return Features(
        compute=compute,
        timer_queries="timer-queries" not in without and not is_software,
        uniform_block_bytes=0 if "uniform-decoders" in without else int(gl.info["GL_MAX_UNIFORM_BLOCK_SIZE"]),
        weights_in_image=not compute or ("weights-in-image" not in without and is_software),
        half_arithmetic=None if "half-arithmetic" in without or not compute else half_arithmetic(gl),
        anisotropy=1 if "anisotropy" in without else max(1, int(gl.max_anisotropy)),
    )
