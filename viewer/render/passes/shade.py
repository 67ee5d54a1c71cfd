"""Shading pass: the picture of a slot from its maps, either lit or one of the maps without light."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import PLANES, MapName, Plane
from viewer.gl.allocation import replace_content
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.lighting.sky import SUN_RADIUS
from viewer.render.pass_scheduler import RenderPass
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.layout import MAP_BITS, MOST_LIGHTS, TextureUnit, UniformBinding
from viewer.render.resources.light import LIGHT_RECORD, SceneLight, light_records
from viewer.render.resources.visibility_buffer import VisibilityInputs
from viewer.state.view_state import MaterialView, ToneMap

SHOWN_MAPS: Final[dict[MaterialView, int]] = {"normal": 0, "orm": 1, "emissive": 2}
"""Values of VIEW in shaders/passes/shade/show_map.frag."""
TONE_MAP_CODES: Final[dict[ToneMap, int]] = {"none": 0, "neutral": 1, "agx": 2}


PlaneTargets = Mapping[Plane, ColorTarget]
"""Decoded planes of one picture (ntc/codec/maps.py). Planes that the view does not need are absent."""


@dataclass(frozen=True)
class ShadeInputs:
    """Inputs of the shading pass. The contents of planes and light maps are read by version."""

    view: VisibilityInputs
    """Visibility buffer, with normals and tangents if `material_view` is `lit`."""
    planes: PlaneTargets
    material_view: MaterialView
    """View of the maps: any but `base`, which needs no shading."""
    light: SceneLight | None = None
    """Light of a `lit` view; None for others."""
    other: PlaneTargets | None = None
    """Planes of the same view from another source, if a slot shows single maps of a pack."""
    other_maps: frozenset[MapName] = frozenset()
    """Maps that are taken from `other`; the rest are taken from `planes`."""


@dataclass(frozen=True, eq=False)
class ViewRays:
    """Rays through the pixels of a view; all positions are relative to `eye`."""

    eye: NDArray[np.float64]
    """[3] world space: the camera's position; any point for parallel rays."""
    from_clip: NDArray[np.float64]
    """[4, 4] clip space to positions relative to the eye."""
    middle: NDArray[np.float64]
    """[3] direction through the centre of the picture, of any length."""
    right: NDArray[np.float64]
    """[3] vector that is added to `middle` at the right edge."""
    up: NDArray[np.float64]
    """[3] vector that is added to `middle` at the upper edge."""


def view_rays(matrix: NDArray[np.float64]) -> ViewRays:
    """Return the rays of a view with the world-to-clip `matrix` [4, 4]."""
    inverse = np.linalg.inv(matrix)
    apex = inverse[:, 2]
    has_apex = abs(apex[3]) > 1e-9 * float(np.linalg.norm(apex[:3]))
    near = inverse @ [0.0, 0.0, -1.0, 1.0]
    eye = apex[:3] / apex[3] if has_apex else near[:3] / near[3]
    shifted = np.eye(4)
    shifted[:3, 3] = eye
    from_clip: NDArray[np.float64] = np.asarray(np.linalg.inv(matrix @ shifted), np.float64)

    def far(x: float, y: float) -> NDArray[np.float64]:
        place = from_clip @ [x, y, 1.0, 1.0]
        return np.asarray(place[:3] / place[3])

    middle = far(0.0, 0.0)
    if not has_apex:
        return ViewRays(eye, from_clip, middle, np.zeros(3), np.zeros(3))
    scale = float(np.linalg.norm(middle))
    return ViewRays(eye, from_clip, middle / scale, (far(1.0, 0.0) - middle) / scale, (far(0.0, 1.0) - middle) / scale)


def _matrix_bytes(matrix: NDArray[np.float64]) -> bytes:
    return matrix.T.astype("<f4").tobytes()


class ShadePass(RenderPass[ShadeInputs, ColorTarget]):
    """Pass that shades a picture. Output: a ColorTarget, linear light in [0, 1].

    Alpha is 1 where a surface is visible. Other pixels show the environment, or black."""

    name = "shade"

    def __init__(self, context: GraphicsContext, programs: ProgramFactory) -> None:
        self._context, self._programs = context, programs
        self._lights: moderngl.Buffer | None = None

    def run(self, inputs: ShadeInputs, output: ColorTarget) -> None:
        """Draw the picture. Raises ValueError if a lit view lacks light, normals or base colours, ShaderError."""
        defines = self._bind_planes(inputs)
        inputs.view.bind()
        if inputs.material_view == "lit":
            self._draw_lit(inputs, defines, output)
            return
        program = self._fullscreen("show_map.frag", {**defines, "VIEW": SHOWN_MAPS[inputs.material_view]})
        output.framebuffer.use()
        self._draw(inputs, program)

    def _draw(self, inputs: ShadeInputs, program: moderngl.VertexArray) -> None:
        if inputs.other is not None:
            bits = sum(MAP_BITS[name] for name in inputs.other_maps)
            set_uniforms(program.program, {"other_maps": bits})
        set_uniforms(program.program, {"depth": 0.0})
        self._context.gl.enable_only(moderngl.NOTHING)
        program.render(moderngl.TRIANGLES, vertices=3)

    def _draw_background(self, program: moderngl.VertexArray, depth: moderngl.Texture, output: ColorTarget) -> None:
        """Draw `program` on the background. The depth test selects it, which costs less than a branch in every pixel."""
        gl = self._context.gl
        framebuffer = output.framebuffer_with_depth(depth)
        try:
            framebuffer.use()
            framebuffer.depth_mask = False
            gl.enable_only(moderngl.DEPTH_TEST)
            gl.depth_func = "=="
            set_uniforms(program.program, {"depth": 1.0})
            program.render(moderngl.TRIANGLES, vertices=3)
        finally:
            gl.depth_func = "<"

    def _fullscreen(self, fragment: str, defines: dict[str, int]) -> moderngl.VertexArray:
        return self._programs.fullscreen(f"passes/shade/{fragment}", defines)

    @staticmethod
    def _bind_planes(inputs: ShadeInputs) -> dict[str, int]:
        defines = {"MIXED": int(inputs.other is not None)}
        for prefix, planes, first in (
            ("", inputs.planes, TextureUnit.PLANE_BASE),
            ("OTHER_", inputs.other or {}, TextureUnit.OTHER_BASE),
        ):
            for number, plane in enumerate(PLANES):
                if plane in planes:
                    planes[plane].texture.use(int(first) + number)
                if plane != "base":
                    defines[f"{prefix}{plane.upper()}_PLANE"] = int(plane in planes)
        return defines

    def _draw_lit(self, inputs: ShadeInputs, defines: dict[str, int], output: ColorTarget) -> None:
        light, target = inputs.light, inputs.view.visibility
        needs_other = "base" in inputs.other_maps and "base" not in (inputs.other or {})
        if light is None or "base" not in inputs.planes or needs_other or not target.content.frame:
            raise ValueError("a lit view needs light, normals and base colours")
        rays = view_rays(inputs.view.matrix)
        tones = {"TONE_MAP": TONE_MAP_CODES[light.tone_map]}
        shared = {
            "ray_middle": tuple(rays.middle),
            "ray_right": tuple(rays.right),
            "ray_up": tuple(rays.up),
            "picture_size": target.size,
            "exposure_factor": 2.0**light.exposure,
            "sun_direction": light.sun.direction,
        }
        surfaces = self._surfaces(light, rays, {**defines, **tones})
        set_uniforms(surfaces.program, shared)
        # Shaders read depths without comparison.
        target.depth.compare_func = ""
        target.depth.use(int(TextureUnit.SURFACE_DEPTH))
        output.framebuffer.use()
        self._draw(inputs, surfaces)
        disk = {"SUN_DISK": int(light.sun.shines and light.shows_sun)}
        background = self._fullscreen("background.frag", {**tones, **disk})
        light.environment.bind(background.program, light.turn)
        radiance = tuple(value / (np.pi * SUN_RADIUS**2) for value in light.sun.irradiance)
        set_uniforms(background.program, {**shared, "sun_radius": SUN_RADIUS, "sun_radiance": radiance})
        self._draw_background(background, target.depth, output)

    def _surfaces(self, light: SceneLight, rays: ViewRays, defines: dict[str, int]) -> moderngl.VertexArray:
        """Return the program that lights surfaces, with its uniforms and textures set."""
        shadow, view = light.shadow, light.shadow_view
        lights = min(len(light.lights), MOST_LIGHTS)
        defines |= {
            "SUN": int(light.sun.shines),
            "SHADOWS": int(shadow is not None and view is not None and light.sun.shines),
            "LIGHTS": int(lights > 0),
            **light.kinds.defines(),
        }
        drawn = self._fullscreen("shade.frag", defines)
        light.environment.bind(drawn.program, light.turn)
        values: dict[str, object] = {
            "from_clip": _matrix_bytes(rays.from_clip),
            "sun_irradiance": light.sun.irradiance,
            "light_count": lights,
        }
        if shadow is not None and view is not None:
            shifted = np.eye(4)
            shifted[:3, 3] = rays.eye
            shadow.depth.use(int(TextureUnit.SHADOW))
            values["to_shadow"] = _matrix_bytes(view.to_map @ shifted)
            values["shadow_texel"] = view.texel
        if lights:
            if self._lights is None:
                size = MOST_LIGHTS * LIGHT_RECORD.itemsize
                self._lights = self._context.memory.buffer("lights", reserve=size, dynamic=True)
            replace_content(self._lights, light_records(light.lights, rays.eye).tobytes())
            self._lights.bind_to_uniform_block(int(UniformBinding.LIGHTS))
        set_uniforms(drawn.program, values)
        return drawn

    def release(self) -> None:
        """Free the buffer of lights."""
        if self._lights is not None:
            self._lights.release()
            self._lights = None
