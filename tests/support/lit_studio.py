"""Lit pictures of small scenes whose planes are given as arrays, on the GPU and by the float64 twin."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import PLANES, MapName, Plane
from tests.support.picture_scenes import Part, placed, scene_of, sphere
from tests.support.ray_caster import camera_rays
from viewer.gl.context import GraphicsContext
from viewer.gl.timer import PassTimer
from viewer.lighting.directions import octahedral_directions, turned
from viewer.lighting.prefilter import PrefilteredEnvironment, sample_panorama
from viewer.lighting.shading import LightSources, SurfaceSamples, shade
from viewer.lighting.sky import SUN_RADIUS
from viewer.lighting.tone_maps import tone_mapped
from viewer.render.light_drawer import LightDrawer
from viewer.render.pass_scheduler import Output, PassScheduler
from viewer.render.passes.shade import PlaneTargets, ShadeInputs, ShadePass
from viewer.render.render_context import RenderContext
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.light import SceneLight
from viewer.render.resources.pack_buffers import scene_programs
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.render.resources.visibility_buffer import SurfaceContent, VisibilityInputs, VisibilityTarget
from viewer.render.scene_drawer import SceneDrawer
from viewer.scene.model import Camera, Light, Material, Scene, SurfaceFactors
from viewer.state.view_state import Lighting, MaterialView

Array = NDArray[np.float64]
Planes = dict[str, NDArray[np.float32]]
"""By plane: [H, W, 4], row 0 on top."""


@dataclass(frozen=True)
class Spheres:
    """A grid of spheres, and cameras that see it."""

    scene: Scene
    camera: Camera


def sphere_grid(
    factors: list[list[SurfaceFactors]], base: tuple[float, float, float] = (1.0, 1.0, 1.0), steps: int = 24
) -> Spheres:
    """A sphere of radius 0.45 for each of `factors`, a unit apart, rows from the top, over a floor; normals and tangents are given."""
    rows, columns = len(factors), len(factors[0])
    parts, materials = list[Part](), list[Material]()
    for y, row in enumerate(factors):
        for x, material_factors in enumerate(row):
            place = placed(x - (columns - 1) / 2, (rows - 1) / 2 - y, 0.0, (0.45, 0.45, 0.45))
            parts.append(sphere(len(materials), place, steps=steps))
            materials.append(Material(f"{y} {x}", -1, (*base, 1.0), factors=material_factors))
    floor = placed(0.0, -rows / 2, 0.0, (columns, 1.0, columns))
    flat = floor @ np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], np.float32)
    parts.append(Part(len(materials), transforms=(flat,)))
    materials.append(Material("floor", -1, (0.4, 0.4, 0.4, 1.0), factors=SurfaceFactors(metalness=0.0)))
    scene = scene_of(parts, materials)
    normals = np.concatenate([*(part.positions for part in parts[:-1]), np.tile([0.0, 0.0, 1.0], (4, 1))])
    around = np.stack([normals[:, 2], np.zeros(len(normals)), -normals[:, 0], np.ones(len(normals))], axis=-1)
    geometry = replace(scene.geometry, normals=normals.astype(np.float32), tangents=around.astype(np.float32))
    eye = (0.3, 0.2, 1.6 * max(rows, columns))
    return Spheres(replace(scene, geometry=geometry), Camera("front", eye, (0.0, -0.1, 0.0), fov_degrees=45.0))


def _from_octahedron(place: Array) -> Array:
    """[..., 3] of shaders/common/frame.glsl, whose octahedron stands on z."""
    swapped = octahedral_directions(place * 0.5 + 0.5)
    return np.asarray(swapped[..., [0, 2, 1]])


def unpacked_frames(words: NDArray[np.uint32]) -> tuple[Array, Array]:
    """(normals [..., 3], tangents [..., 4]) of frames [..., 2]."""
    normal = words[..., 0, None] >> np.array([0, 16], np.uint32) & np.uint32(0xFFFF)
    tangent = words[..., 1, None] >> np.array([0, 15], np.uint32) & np.uint32(0x7FFF)
    handedness = np.where(words[..., 1] >> np.uint32(31), -1.0, 1.0)[..., None]
    snorm = np.maximum(normal.astype(np.uint16).view(np.int16) / 32767.0, -1.0)
    return _from_octahedron(snorm), np.concatenate(
        [_from_octahedron(tangent / 32766.0 * 2.0 - 1.0), handedness], axis=-1
    )


class LitStudio:
    """Draws one scene, lit."""

    def __init__(self, context: GraphicsContext, scene: Scene, camera: Camera, size: tuple[int, int]) -> None:
        self.scene, self.camera, self.size, self._context = scene, camera, size, context
        self.programs = scene_programs(context)
        self.buffers = SceneBuffers(context, scene)
        self.scheduler = PassScheduler(PassTimer(context))
        shared = RenderContext(context, self.programs, scene, self.buffers, self.scheduler)
        self.drawer = SceneDrawer(shared)
        self.light_drawer = LightDrawer(shared, self.drawer)
        self.visibility = VisibilityTarget(context, size, SurfaceContent(False, gradients=False, frame=True))
        self.shade_pass = ShadePass(context, self.programs)
        self.target = ColorTarget(context, size)
        self._planes: dict[tuple[str, str], ColorTarget] = {}
        self._written = Output(0)

    def view(self) -> VisibilityInputs:
        """The visibility buffer, drawn."""
        return self.drawer.draw(self.camera, self.visibility)

    def planes(self, planes: Mapping[str, NDArray[np.float32]], name: str = "a") -> PlaneTargets:
        """Targets that hold `planes`."""
        targets: dict[Plane, ColorTarget] = {}
        self._written = Output(self._written.version + 1)
        for plane in (plane for plane in PLANES if plane in planes):
            target = self._planes.setdefault((name, plane), ColorTarget(self._context, self.size))
            target.texture.write(np.ascontiguousarray(planes[plane][::-1], np.float32).tobytes())
            targets[plane] = target
        return targets

    def draw(
        self,
        planes: PlaneTargets,
        material_view: MaterialView = "lit",
        light: SceneLight | None = None,
        other: PlaneTargets | None = None,
        other_maps: frozenset[MapName] = frozenset(),
    ) -> NDArray[np.float32]:
        """[H, W, 3] the picture."""
        inputs = ShadeInputs(self.view(), planes, material_view, light, other, other_maps)
        reads = (self._written, *(() if light is None else light.outputs))
        self.scheduler.advance(self.shade_pass, inputs, self.target, reads)
        return self.target.read()

    def factor_base(self) -> NDArray[np.float32]:
        """[H, W, 4] base colours of materials without textures."""
        materials = self.materials()
        factors = np.array([material.factor for material in self.scene.materials], np.float32)
        return np.where((materials >= 0)[..., None], factors[materials], 0.0).astype(np.float32)

    def materials(self) -> NDArray[np.int32]:
        """[H, W] material of each pixel."""
        self.view()
        return self.visibility.materials()

    def depths(self) -> Array:
        """[H, W] depth of each pixel, 0 to 1."""
        words = np.frombuffer(self.visibility.depth.read(), np.float32)
        return words.reshape(self.size[1], self.size[0])[::-1].astype(np.float64)

    def places(self) -> Array:
        """[H, W, 3] what each pixel sees, world space, by its depth."""
        width, height = self.size
        x = (np.arange(width) + 0.5) / width * 2.0 - 1.0
        y = 1.0 - (np.arange(height) + 0.5) / height * 2.0
        columns, rows = np.meshgrid(x, y)
        clip = np.stack([columns, rows, self.depths() * 2.0 - 1.0, np.ones_like(columns)], axis=-1)
        world = clip @ np.linalg.inv(self.view().matrix).T
        return np.asarray(world[..., :3] / world[..., 3:])

    def expected(
        self,
        planes: Mapping[str, NDArray[np.float32]],
        environment: PrefilteredEnvironment,
        panorama: NDArray[np.float32],
        lighting: Lighting,
        light: SceneLight,
        lights: tuple[Light, ...] = (),
        sun_share: Array | None = None,
    ) -> Array:
        """[H, W, 3] the picture as the float64 twin draws it; `sun_share` [H, W], None: all of it."""
        view, materials = self.view(), self.materials()
        shape = (self.size[1], self.size[0])
        covered = materials >= 0
        rays = camera_rays(self.camera, self.size)[1].reshape(*shape, 3)
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        normals, tangents = unpacked_frames(view.visibility.frames())
        hit_materials = [self.scene.materials[number] for number in materials[covered]]
        neutral = {"surface": np.array([0.5, 0.5, 1.0, 1.0]), "emission": np.ones(4)}
        held = {
            name: np.asarray(planes.get(name, np.tile(neutral.get(name, np.ones(4)), (*shape, 1))), np.float64)
            for name in ("base", "surface", "emission")
        }
        samples = SurfaceSamples(
            [material.factors for material in hit_materials],
            held["base"][covered][:, :3],
            held["surface"][covered],
            held["emission"][covered],
            normals[covered],
            tangents[covered],
            self.places()[covered],
            -rays[covered],
            [material.unlit for material in hit_materials],
        )
        sources = LightSources(environment, light.turn, light.sun.direction, light.sun.irradiance, lights)
        share = None if sun_share is None else sun_share[covered][:, None]
        radiance = sample_panorama(panorama.astype(np.float64), turned(rays, -light.turn))
        away = np.linalg.norm(rays - np.array(light.sun.direction), axis=-1)
        disk = np.clip((SUN_RADIUS - away) / (0.1 * SUN_RADIUS) + 0.5, 0.0, 1.0) * float(light.shows_sun)
        radiance = radiance + disk[..., None] * np.array(light.sun.irradiance) / (np.pi * SUN_RADIUS**2)
        radiance[covered] = shade(samples, sources, share)
        picture = tone_mapped(radiance, lighting.exposure, lighting.tone_map)
        unlit = np.zeros(shape, bool)
        unlit[covered] = samples.unlit
        picture[unlit] = np.clip(radiance[unlit], 0.0, 1.0)
        return picture

    def release(self) -> None:
        """Free everything."""
        for target in (self.target, *self._planes.values()):
            target.release()
        self.visibility.release()
        self.shade_pass.release()
        self.light_drawer.release()
        self.buffers.release()
        self.programs.release()
