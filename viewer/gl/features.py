"""Optional features of OpenGL: those of the driver, without those that the environment switches off."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import moderngl

from ntc.errors import InputError
from viewer.gl.limits import Limits
from viewer.gl.program import EXTENSION, ShaderLibrary
from viewer.locations import shaders_folder

COMPUTE_VERSION: Final = 430
"""Version of OpenGL with compute shaders (4.3)."""
DRAWING_VERSION: Final = 410
"""Oldest version of OpenGL that can draw (4.1, the last of macOS)."""
WITHOUT_VARIABLE: Final = "NTC_VIEWER_WITHOUT"
"""Environment variable with the features of NAMES, separated by commas, that are not used although the driver has them."""
NAMES: Final = (
    "compute",
    "timer-queries",
    "uniform-decoders",
    "weights-in-image",
    "half-arithmetic",
    "anisotropy",
    "shared-sums",
)
HALF_EXTENSIONS: Final = (
    "GL_EXT_shader_explicit_arithmetic_types_float16",
    "GL_AMD_gpu_shader_half_float",
    "GL_NV_gpu_shader5",
)
"""GLSL extensions with the types `float16_t` and `f16vec4`, the most specific first."""
_HALF_PROBE: Final = """#version 430
layout(local_size_x = 1) in;
#include "ntc/half.glsl"
layout(std430, binding = 0) buffer Values { vec4 values[]; };
void main() {
    ACC_T sum = ACC_T(values[0]);
    ODD_ACCUMULATOR(odd)
    ADD_PRODUCT(sum, MUL_T(values[1]), MUL_SCALAR(values[2].x));
    ADD_ODD_PRODUCT(sum, odd, MUL_T(values[1]), MUL_SCALAR(to_half(values[2].y)));
    JOIN_ACCUMULATORS(sum, odd)
    sum = ADAPTED(sum, values[3], values[4]);
    sum = LEAKY(sum, 0.01);
    values[5] = vec4(AS_MUL_T(sum)) + PRODUCT_SUM(sum, values[6]);
}
"""
"""Shader that does in halves what decoders do (shaders/ntc/half.glsl)."""


@dataclass(frozen=True)
class Features:
    """Optional features in use. Pictures do not depend on them, but for anisotropic filtering and half arithmetic."""

    compute: bool
    """True with OpenGL 4.3: compute shaders, storage buffers. False: OpenGL 4.1 at least, with paths `forward` and `cached`."""
    timer_queries: bool
    """True if timer queries of the GPU time passes, else wall time around `finish()`."""
    uniform_block_bytes: int
    """Largest decoder in bytes that is bound as a uniform buffer; larger ones are read from a storage buffer."""
    weights_in_image: bool
    """True where the weights of decoders lie in an image, which software renderers read several times faster than buffers."""
    half_arithmetic: str | None
    """Extension of GLSL for half-precision arithmetic; None: precisions that need it are refused."""
    anisotropy: int
    """Largest anisotropy of the driver's filter; 1: none."""
    shared_sums: bool
    """True where a work group adds up its counts in shared memory first: global atomics collide on GPUs, barriers are slow on CPUs."""


def features_without(names: str) -> frozenset[str]:
    """Return the features that WITHOUT_VARIABLE names. Raises InputError for a name that is not in NAMES."""
    given = frozenset(name.strip() for name in names.split(",") if name.strip())
    for name in sorted(given - set(NAMES)):
        raise InputError(f"{WITHOUT_VARIABLE}: {name!r} is none of {', '.join(NAMES)}")
    return given


def half_probes(extension: str) -> tuple[str, ...]:
    """Return GLSL of compute shaders that do what decoders do in halves: with products alone in halves, and with sums as well."""
    library = ShaderLibrary(shaders_folder(), {"half_probe.comp": _HALF_PROBE})
    levels = ({EXTENSION: extension, "HALF_ARITHMETIC": level} for level in (1, 2))
    return tuple(library.assemble("half_probe.comp", defines).text for defines in levels)


def half_arithmetic(gl: moderngl.Context) -> str | None:
    """Return the first of HALF_EXTENSIONS with which the driver compiles what decoders do in halves; None where there is none."""
    for extension in HALF_EXTENSIONS:
        try:
            for probe in half_probes(extension):
                gl.compute_shader(probe).release()
        except moderngl.Error:
            continue
        return extension
    return None


def find_features(gl: moderngl.Context, is_software: bool, environment: Mapping[str, str] = os.environ) -> Features:
    """Find the features to use with this driver. Raises InputError where WITHOUT_VARIABLE names an unknown one."""
    without = features_without(environment.get(WITHOUT_VARIABLE, ""))
    # llvmpipe's timer queries return nonsense.
    compute = "compute" not in without and gl.version_code >= COMPUTE_VERSION
    return Features(
        compute=compute,
        timer_queries="timer-queries" not in without and not is_software,
        uniform_block_bytes=0 if "uniform-decoders" in without else Limits.of(gl.info).uniform_block_bytes,
        weights_in_image=not compute or ("weights-in-image" not in without and is_software),
        half_arithmetic=None if "half-arithmetic" in without or not compute else half_arithmetic(gl),
        anisotropy=1 if "anisotropy" in without else max(1, int(gl.max_anisotropy)),
        shared_sums="shared-sums" not in without and not is_software,
    )
