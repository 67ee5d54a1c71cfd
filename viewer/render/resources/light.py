"""Light of a view on the GPU: the prefiltered environment, the sun's shadow map, and the lights of the scene."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Final

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext
from viewer.gl.program import set_uniforms
from viewer.lighting.brdf import brdf_table
from viewer.lighting.prefilter import PrefilterSize
from viewer.lighting.sky import Sun
from viewer.render.pass_scheduler import Output
from viewer.render.resources.layout import MOST_LIGHTS, TextureUnit
from viewer.scene.model import Light, Material, SurfaceFactors
from viewer.state.view_state import ToneMap

LINEAR = (moderngl.LINEAR, moderngl.LINEAR)


class EnvironmentMaps:
    """Textures of one environment: the panorama, and the prefiltered maps that PrefilterPass writes."""

    def __init__(self, context: GraphicsContext, size: PrefilterSize, panorama_width: int) -> None:
        """Allocate the textures; `panorama_width`: texels across, twice the height. Raises GpuMemoryError."""
        self.size, self.panorama_width = size, panorama_width
        what, memory = f"an environment of {panorama_width} x {panorama_width // 2}", context.memory
        table = np.ascontiguousarray(brdf_table(), np.float32)
        with memory.transaction():
            self.panorama = memory.texture(what, (panorama_width, panorama_width // 2), 3, dtype="f2", alignment=2)
            # Nothing writes the texels between the maps. They must be defined, because the disk cache stores them.
            zeros = bytes(16 * math.prod(size.texture_size))
            self.maps = memory.texture(what, size.texture_size, 4, zeros, dtype="f4")
            self.table = memory.texture(what, (table.shape[1], table.shape[0]), 2, table.tobytes(), dtype="f4")
        for texture in (self.panorama, self.maps, self.table):
            texture.filter = LINEAR
            texture.repeat_x = texture.repeat_y = False
        self.panorama.repeat_x = True

    @property
    def tiles(self) -> NDArray[np.float32]:
        """[levels + 1, 4] left, top, width and height of each map's first face without border, relative to the size of `maps`."""
        width, height = self.size.texture_size
        rows = [
            (1.0 / width, (top + 1) / height, side / width, side / height)
            for top, side in zip(self.size.tops, self.size.all_sides, strict=True)
        ]
        return np.array(rows, np.float32)

    def write_panorama(self, pixels: NDArray[np.float32]) -> None:
        """Replace the panorama by `pixels` [H, 2 H, 3], row 0 on top."""
        self.panorama.write(np.ascontiguousarray(pixels, np.float16).tobytes())

    def bind(self, program: moderngl.Program, turn: float) -> None:
        """Bind the textures for shaders/lighting/environment.glsl, turned by `turn` degrees from north towards east."""
        self.panorama.use(int(TextureUnit.PANORAMA))
        self.maps.use(int(TextureUnit.ENVIRONMENT))
        self.table.use(int(TextureUnit.BRDF_TABLE))
        values = {
            "environment_tiles": self.tiles.tobytes(),
            "face_gap": 2.0 / self.size.texture_size[0],
            "environment_turn": (math.cos(math.radians(turn)), math.sin(math.radians(turn))),
        }
        set_uniforms(program, values)

    def release(self) -> None:
        """Free the textures."""
        for texture in (self.panorama, self.maps, self.table):
            texture.release()


SHADOW_SIDE: Final = 2048
"""Side of the shadow map in texels."""
MARGIN: Final = 0.01
"""Margin on each side of the shadow map, relative to the scene's extent."""


@dataclass(frozen=True, eq=False)
class ShadowView:
    """View of a scene from the sun."""

    matrix: NDArray[np.float64]
    """[4, 4] world to clip."""
    texel: float
    """Longer side of a texel of the map, in world units."""

    @property
    def to_map(self) -> NDArray[np.float64]:
        """[4, 4] world to the map's x, y and depth, all in [0, 1]."""
        halves = np.diag([0.5, 0.5, 0.5, 1.0])
        halves[:3, 3] = 0.5
        return np.asarray(halves @ self.matrix)


def shadow_view(bounds: NDArray[np.float32], direction: tuple[float, float, float]) -> ShadowView:
    """Return the view of `bounds` [2, 3] along the light of a sun in `direction` (unit vector)."""
    backward = np.array(direction, np.float64)
    helper = np.array([0.0, 0.0, 1.0]) if abs(backward[1]) > 0.9 else np.array([0.0, 1.0, 0.0])
    right = np.cross(helper, backward)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(backward, right), backward])
    low, high = bounds.astype(np.float64)
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    seen = corners @ axes.T
    nearest, farthest = seen.min(axis=0), seen.max(axis=0)
    centre, half = (nearest + farthest) / 2.0, (farthest - nearest) / 2.0
    half = np.maximum(half * (1.0 + MARGIN), 1e-3 * max(float(half.max()), 1e-6))
    matrix = np.eye(4)
    # Depth grows away from the sun.
    matrix[:3, :3] = axes * (np.array([1.0, 1.0, -1.0]) / half)[:, None]
    matrix[:3, 3] = -centre * np.array([1.0, 1.0, -1.0]) / half
    return ShadowView(matrix, float(2.0 * half[:2].max() / SHADOW_SIDE))


class ShadowMap:
    """Shadow map of the sun: a depth texture, and its framebuffer."""

    def __init__(self, context: GraphicsContext, side: int = SHADOW_SIDE) -> None:
        """Allocate the map. Raises GpuMemoryError."""
        what = f"a shadow map of {side} x {side}"
        with context.memory.transaction():
            self.depth = context.memory.depth_texture(what, (side, side))
            self.framebuffer = context.memory.framebuffer(what, [], self.depth)
        # Shaders compare depths themselves.
        self.depth.compare_func = ""
        self.depth.repeat_x = self.depth.repeat_y = False

    def read(self) -> NDArray[np.float32]:
        """Return the depths: [side, side] float32 in [0, 1], row 0 at the bottom."""
        return np.frombuffer(self.depth.read(), np.float32).reshape(self.depth.size[1], self.depth.size[0])

    def release(self) -> None:
        """Free the texture."""
        self.framebuffer.release()
        self.depth.release()


LIGHT_RECORD = np.dtype(
    [("color", "<f4", (4,)), ("position", "<f4", (4,)), ("direction", "<f4", (4,)), ("cone", "<f4", (4,))]
)
"""Record of a light (shaders/lighting/lights.glsl): std140, 64 bytes."""


@dataclass(frozen=True)
class SurfaceKinds:
    """Kinds of factors that some material of a scene has. Shaders leave out the others, because every pixel would pay for them."""

    clearcoat: bool = False
    specular: bool = True
    """True if a material has another reflectance than that of ior 1.5, or transmission."""
    emissive: bool = True
    unlit: bool = True

    @staticmethod
    def of(materials: Sequence[Material]) -> "SurfaceKinds":
        """Return the kinds of factors that any of `materials` has."""
        factors = [material.factors for material in materials]
        plain = SurfaceFactors()
        return SurfaceKinds(
            any(each.clearcoat > 0.0 for each in factors),
            any(
                (each.ior, each.specular, each.specular_color, each.transmission)
                != (plain.ior, plain.specular, plain.specular_color, plain.transmission)
                for each in factors
            ),
            any(max(each.emissive) > 0.0 for each in factors),
            any(material.unlit for material in materials),
        )

    def defines(self) -> dict[str, int]:
        """Return the defines of shaders/passes/shade/shade.frag."""
        return {kind.name.upper(): int(getattr(self, kind.name)) for kind in fields(self)}


@dataclass(frozen=True)
class SceneLight:
    """Light of a view, as the shading pass reads it. Equal values give equal light."""

    environment_key: str
    """Key of the environment that the maps show."""
    turn: float
    """Turn of the environment in degrees from north towards east."""
    sun: Sun
    shows_sun: bool
    """True if the sun's disk is drawn in front of the environment."""
    exposure: float
    """Exposure in stops."""
    tone_map: ToneMap
    environment: EnvironmentMaps = field(compare=False)
    shadow: ShadowMap | None = None
    """Shadow map of the sun; None if the sun does not shine."""
    shadow_view: ShadowView | None = field(default=None, compare=False)
    lights: tuple[Light, ...] = ()
    kinds: SurfaceKinds = SurfaceKinds()
    outputs: tuple[Output, ...] = field(default=(), compare=False)
    """Outputs of the passes that made the environment and the shadow map."""


def light_records(lights: tuple[Light, ...], eye: NDArray[np.float64]) -> NDArray[np.void]:
    """Return [MOST_LIGHTS] LIGHT_RECORD of the first MOST_LIGHTS lights, with positions relative to `eye` [3]."""
    records = np.zeros(MOST_LIGHTS, LIGHT_RECORD)
    for record, light in zip(records, lights, strict=False):
        axis = np.array(light.direction, np.float64)
        axis /= max(float(np.linalg.norm(axis)), 1e-30)
        record["color"][:3] = light.color
        record["direction"][:3] = axis
        if light.kind == "directional":
            record["position"][:3] = -axis
            continue
        record["position"] = (*(np.array(light.position) - eye), 1.0)
        record["color"][3] = 1.0 / light.reach**2 if light.reach > 0.0 else 0.0
        # A light without a cone has the factor 0 * cosine + 1.
        scale, offset = 0.0, 1.0
        if light.kind == "spot":
            scale = 1.0 / max(0.001, math.cos(light.inner_cone) - math.cos(light.outer_cone))
            offset = -math.cos(light.outer_cone) * scale
        record["cone"][0], record["direction"][3] = scale, offset
    return records
