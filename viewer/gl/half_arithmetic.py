"""Whether the driver computes with halves, found out by compiling a small shader."""

import moderngl

EXTENSIONS = (
    "GL_NV_gpu_shader5",
    "GL_AMD_gpu_shader_half_float",
    "GL_EXT_shader_explicit_arithmetic_types_float16",
)
"""GLSL extensions with the types `float16_t` and `f16vec4`, the most common first."""

_PROBE = """#version 430
#extension {extension} : require
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Values {{ vec4 values[]; }};
void main() {{
    f16vec4 factors = f16vec4(values[0]);
    float16_t sum = factors.x * factors.y + float16_t(0.5);
    values[1] = vec4(max(factors, sum * factors));
}}
"""


def half_arithmetic(gl: moderngl.Context) -> str | None:
    """Name of the extension that gives shaders half arithmetic, or None where the driver has none."""
    for extension in EXTENSIONS:
        try:
            gl.compute_shader(_PROBE.format(extension=extension)).release()
        except moderngl.Error:
            continue
        return extension
    return None
