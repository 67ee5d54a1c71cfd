"""The reference path against a plain loop of one draw for each mesh, interleaved frame by frame.

    python -m lab.benchmarks.plain_loop scene.gltf --cameras cameras.json --size 1280x720

The plain loop is what one writes first in moderngl: a vertex array for each primitive, an sRGB texture with
trilinear mipmaps for each image, back faces culled, depth test, linear albedo to an RGBA8 framebuffer. It neither
culls nor sorts. Times are wall time around `finish()`, medians in ms. "python" is the time that is not drawing: for
the plain loop until all calls are made (a software renderer may draw during some of them), for the viewer the frame less its passes.
"""

import sys
import time
from collections import defaultdict
from dataclasses import dataclass
from typing import Any, cast

import moderngl
import numpy as np

from lab.bench.scene import nudged
from lab.benchmarks.measuring import arguments, chosen_cameras, median, report
from ntc.errors import InputError
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.render.renderer import Renderer
from viewer.scene.load import load_scene
from viewer.scene.model import Camera, Scene
from viewer.state.camera import view_projection
from viewer.state.view_state import ViewState

SRGB8_ALPHA8 = 0x8C43
WARM_UP_FRAMES = 2
PASSES = ("visibility", "reference", "composite")
CPU_STEPS = ("cull",)
"""Entries of a frame's times that are spent in Python."""

VERTEX = """#version 430
in vec3 position;
in vec2 texture_coordinate;
uniform mat4 model;
uniform mat4 view_projection;
out vec2 uv;
void main() {
    gl_Position = view_projection * model * vec4(position, 1.0);
    uv = texture_coordinate;
}
"""
FRAGMENT = """#version 430
in vec2 uv;
uniform sampler2D image;
uniform vec4 factor;
uniform float cutoff;
out vec4 color;
void main() {
    vec4 albedo = factor * texture(image, uv);
    DISCARD
    color = vec4(albedo.rgb, 1.0);
}
"""


@dataclass(frozen=True, eq=False)
class _Draw:
    array: moderngl.VertexArray
    texture: moderngl.Texture
    model: bytes
    factor: tuple[float, float, float, float]
    cutoff: float | None
    double_sided: bool
    mirrored: bool


class PlainLoop:
    """Draws a scene one instance after the other."""

    def __init__(self, context: GraphicsContext, scene: Scene, size: tuple[int, int]) -> None:
        gl = self._gl = context.gl
        self._scene, self._size = scene, size
        self._framebuffer = gl.framebuffer([gl.texture(size, 4)], gl.depth_renderbuffer(size))
        opaque, masked = (
            gl.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT.replace("DISCARD", discard))
            for discard in ("", "if (albedo.a < cutoff) discard;")
        )
        self._programs = (opaque, masked)
        white = gl.texture((1, 1), 4, b"\xff" * 4, internal_format=SRGB8_ALPHA8)
        textures = [self._texture(index) for index in range(len(scene.textures))]
        arrays: dict[int, moderngl.VertexArray] = {}
        self._draws: list[_Draw] = []
        for row, transform in zip(scene.instances.primitive.tolist(), scene.instances.transform, strict=True):
            primitive = scene.primitives[row]
            material = scene.materials[primitive.material]
            is_masked = material.alpha_mode != "opaque"
            if row not in arrays:
                arrays[row] = self._array(row, masked if is_masked else opaque)
            self._draws.append(
                _Draw(
                    arrays[row],
                    textures[material.texture_id] if material.texture_id >= 0 else white,
                    np.ascontiguousarray(transform.T, "<f4").tobytes(),
                    material.factor,
                    material.alpha_cutoff if is_masked else None,
                    material.double_sided,
                    bool(np.linalg.det(transform[:3, :3]) < 0.0),
                )
            )

    def _texture(self, index: int) -> moderngl.Texture:
        image = self._scene.textures[index]
        width, height = image.size
        alpha = np.full((height, width), 255, np.uint8) if image.alpha is None else image.alpha
        pixels = np.dstack([image.pixels, alpha])
        texture = self._gl.texture((width, height), 4, pixels.tobytes(), internal_format=SRGB8_ALPHA8)
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        return texture

    def _array(self, row: int, program: moderngl.Program) -> moderngl.VertexArray:
        primitive, geometry = self._scene.primitives[row], self._scene.geometry
        vertices = slice(primitive.base_vertex, primitive.base_vertex + primitive.vertex_count)
        indices = geometry.indices[primitive.first_index : primitive.first_index + primitive.index_count]
        content = np.concatenate([geometry.positions[vertices], geometry.uvs[vertices]], axis=1).astype("<f4")
        return self._gl.vertex_array(
            program,
            [(self._gl.buffer(content.tobytes()), "3f 2f", "position", "texture_coordinate")],
            self._gl.buffer(indices.astype("<u4").tobytes()),
        )

    def draw(self, camera: Camera) -> None:
        """One frame."""
        gl = self._gl
        matrix = view_projection(camera, self._size, self._scene.bounds).T.astype("<f4").tobytes()
        self._framebuffer.use()
        self._framebuffer.clear(depth=1.0)
        gl.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        for program in self._programs:
            _uniform(program, "view_projection").write(matrix)
        for item in self._draws:
            program = item.array.program
            _uniform(program, "model").write(item.model)
            _uniform(program, "factor").value = item.factor
            if item.cutoff is not None:
                _uniform(program, "cutoff").value = item.cutoff
            item.texture.use(0)
            (gl.disable if item.double_sided else gl.enable)(moderngl.CULL_FACE)
            gl.front_face = "cw" if item.mirrored else "ccw"
            item.array.render()
        gl.front_face = "ccw"


def _uniform(program: moderngl.Program, name: str) -> moderngl.Uniform:
    return cast(moderngl.Uniform, program[name])


def measure(
    context: GraphicsContext, scene: Scene, cameras: tuple[Camera, ...], size: tuple[int, int], frames: int
) -> list[dict[str, Any]]:
    """One row of medians for each camera."""
    loop, renderer = PlainLoop(context, scene, size), Renderer(context, scene)
    rows: list[dict[str, Any]] = []
    for camera in cameras:
        times: dict[str, list[float]] = defaultdict(list)
        for frame in range(-WARM_UP_FRAMES, frames):
            moved = nudged(camera, frame)
            context.gl.finish()
            start = time.perf_counter()
            loop.draw(moved)
            submitted = time.perf_counter()
            context.gl.finish()
            end = time.perf_counter()
            result = renderer.render(ViewState(moved, size))
            context.gl.finish()
            viewer_ms = (time.perf_counter() - end) * 1e3
            if frame < 0:
                continue
            passes = sum(ms for name, ms in result.timings_ms.items() if name not in CPU_STEPS)
            times["plain"].append((end - start) * 1e3)
            times["plain_python"].append((submitted - start) * 1e3)
            times["viewer"].append(viewer_ms)
            times["viewer_python"].append(viewer_ms - passes)
            for name in PASSES:
                times[name].append(result.timings_ms.get(name, 0.0))
        medians = {f"{name} ms".replace("_", " "): median(values) for name, values in times.items()}
        rows.append({"camera": camera.name, "ratio": medians["viewer ms"] / medians["plain ms"], **medians})
    return rows


def main() -> int:
    """Run from the command line."""
    given = arguments(__doc__.splitlines()[0]).parse_args()
    try:
        start = time.perf_counter()
        scene = load_scene(given.scene)
        loading = time.perf_counter() - start
        context = create_headless_context()
        cameras = chosen_cameras(scene, given.cameras, given.camera)
        rows = measure(context, scene, cameras, given.size, given.frames)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    facts = {
        "scene": scene.name,
        "size": "{}x{}".format(*given.size),
        "frames": given.frames,
        "loading_s": round(loading, 2),
        "draws": len(scene.instances.primitive),
        "renderer": context.info.renderer,
    }
    report("Reference frame against a plain draw loop", rows, facts, given.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
