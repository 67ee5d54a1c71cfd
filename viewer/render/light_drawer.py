"""Light of a view: the prefiltered environment and the sun's shadow map, updated only when they change."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ntc.content_cache import ContentCache
from ntc.errors import InputError
from viewer.lighting.panorama import Panorama, load_panorama
from viewer.lighting.prefilter import PANORAMA_SIZE, SKY_SIZE, PrefilterSize
from viewer.lighting.sky import environment_turn, sky_radiance, sun_of
from viewer.lighting.studio import studio
from viewer.locations import cache_folder
from viewer.render.pass_scheduler import Output
from viewer.render.passes.prefilter import PrefilterInputs, PrefilterPass
from viewer.render.passes.shadow import ShadowInputs, ShadowPass
from viewer.render.render_context import RenderContext
from viewer.render.resources.light import EnvironmentMaps, SceneLight, ShadowMap, ShadowView, SurfaceKinds, shadow_view
from viewer.render.scene_drawer import SceneDrawer
from viewer.scene.model import Camera
from viewer.state.view_state import SKY, STUDIO, Lighting

MOST_CACHED_BYTES = 1 << 28
"""Size limit of the disk cache of prefiltered panoramas, in bytes."""


class LightDrawer:
    """Light of one scene: one environment and one shadow map."""

    def __init__(self, context: RenderContext, drawer: SceneDrawer) -> None:
        self._context, self._scene = context.graphics, context.scene
        self._drawer, self._scheduler = drawer, context.scheduler
        cache = ContentCache(cache_folder("environments"), MOST_CACHED_BYTES)
        self._prefilter = PrefilterPass(context.graphics, context.programs, cache)
        self._shadow_pass = ShadowPass(context.graphics, context.programs, context.scene_buffers)
        self._maps: EnvironmentMaps | None = None
        """Environment that is shown."""
        self._shown_key = ""
        """Key of the environment that is shown."""
        self._coming: EnvironmentMaps | None = None
        """Maps that the next environment is filtered into, or spare ones."""
        self._latest: PrefilterInputs | None = None
        self._panorama: tuple[str, Panorama] | None = None
        self._shadow: ShadowMap | None = None
        self._shadow_inputs: ShadowInputs | None = None
        self._kinds = SurfaceKinds.of(context.scene.materials)
        self.problem = ""
        """Message if the last lit picture shows the sky, because its environment file cannot be used; else empty."""

    def prepare_or_sky(self, lighting: Lighting) -> SceneLight:
        """Return the light for `lighting`; the sky replaces an environment file that cannot be used. Raises GpuMemoryError."""
        self.problem = ""
        try:
            return self.prepare(lighting)
        except InputError as error:
            self.problem = f"{error}; the sky is shown instead of {Path(lighting.environment).name}"
            return self.prepare(replace(lighting, environment=SKY))

    def prepare(self, lighting: Lighting) -> SceneLight:
        """Return the light for `lighting`. Raises InputError for an environment file that cannot be used, GpuMemoryError."""
        maps, output = self._environment_maps(*self._environment(lighting))
        outputs = [output]
        sun, view = sun_of(lighting), None
        if sun.shines:
            view, shadow = self._draw_shadow(sun.direction)
            outputs.append(shadow)
        return SceneLight(
            self._shown_key,
            environment_turn(lighting),
            sun,
            lighting.environment == SKY,
            lighting.exposure,
            lighting.tone_map,
            maps,
            self._shadow if view is not None else None,
            view,
            self._scene.lights,
            self._kinds,
            tuple(outputs),
        )

    def _environment(self, lighting: Lighting) -> tuple[PrefilterInputs, PrefilterSize]:
        if lighting.environment == SKY:
            # The azimuth of the sun only turns the sky.
            key = f"{SKY} {lighting.sun_elevation}"
            if self._latest is not None and self._latest.key == key:
                return self._latest, SKY_SIZE
            return PrefilterInputs(key, sky_radiance(lighting.sun_elevation)), SKY_SIZE
        if self._panorama is None or self._panorama[0] != lighting.environment:
            name = lighting.environment
            self._panorama = name, studio() if name == STUDIO else load_panorama(Path(name))
        panorama = self._panorama[1]
        return PrefilterInputs(panorama.digest, panorama.pixels, is_cached=True), PANORAMA_SIZE

    def _environment_maps(self, inputs: PrefilterInputs, size: PrefilterSize) -> tuple[EnvironmentMaps, Output]:
        """Return the maps to draw with, and the output of the requested ones. Earlier maps are drawn until those are complete."""
        self._latest = inputs
        if self._maps is not None and self._shown_key == inputs.key:
            return self._maps, self._scheduler.advance(self._prefilter, inputs, self._maps)
        width, coming = inputs.panorama.shape[1], self._coming
        if coming is None or (coming.size, coming.panorama_width) != (size, width):
            made = EnvironmentMaps(self._context, size, width)
            if coming is not None:
                coming.release()
            coming = self._coming = made
        output = self._scheduler.advance(self._prefilter, inputs, coming)
        if output.is_complete or self._maps is None:
            self._maps, self._coming, self._shown_key = coming, self._maps, inputs.key
        return self._maps, output

    def _draw_shadow(self, direction: tuple[float, float, float]) -> tuple[ShadowView, Output]:
        posed, inputs = self._drawer.posed, self._shadow_inputs
        shadow_key = direction, self._drawer.pose.version, self._drawer.coverage
        if inputs is None or (inputs.direction, inputs.pose, inputs.coverage) != shadow_key:
            bounds = posed.bounds
            view = shadow_view(bounds, direction)
            centre = bounds.astype(np.float64).mean(axis=0)
            reach = float(np.linalg.norm(bounds[1] - bounds[0])) + 1.0
            eye = tuple((centre + np.array(direction) * reach).tolist())
            camera = Camera("sun", eye, tuple(centre.tolist()), orthographic_height=reach)
            draw_list = posed.culling.draw_list(camera, view.matrix)
            inputs = self._shadow_inputs = ShadowInputs(*shadow_key, view, draw_list)
        if self._shadow is None:
            self._shadow = ShadowMap(self._context)
        return inputs.view, self._scheduler.advance(self._shadow_pass, inputs, self._shadow)

    def release(self) -> None:
        """Free everything."""
        self._prefilter.release()
        for part in (self._maps, self._coming, self._shadow):
            if part is not None:
                part.release()
        self._maps = self._coming = self._shadow = None
        self._latest = self._shadow_inputs = None
