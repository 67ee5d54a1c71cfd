"""Viewpoints sampled in a scene without cameras."""

import math
from dataclasses import replace

import numpy as np

from ntc.errors import InputError
from viewer.scene.model import Camera, Scene
from viewer.viewpoints.candidates import CandidateSampler, ViewpointConfig, orbit
from viewer.viewpoints.choice import CRITERIA, CandidateRenderer, DrawTextureIds, choose
from viewer.viewpoints.surfaces import Surfaces

__all__ = ["DrawTextureIds", "ViewpointConfig", "sample_viewpoints"]

WALKING_AND_CLOSE_SHARES = (0.5, 0.3)
"""Shares of the candidates at eye height and close to surfaces; the others are around the scene."""
ORBITS_TRIED = 4
"""Number of views around the scene that are rendered in any case; the rest only where good views are few."""
ENOUGH = 2
"""Number of good views that are enough, for each one asked for."""


def sample_viewpoints(scene: Scene, draw_ids: DrawTextureIds, config: ViewpointConfig) -> tuple[Camera, ...]:
    """Sample at most `config.count` cameras named "sampled_01" and so on, those that add most first; equal seeds give equal cameras.

    Raises InputError where no viewpoint sees a texture.
    """
    if config.count < 1:
        raise InputError(f"viewpoints: count {config.count}; ask for one or more")
    nothing = InputError(f"{scene.name}: no viewpoint sees a texture; name a file of cameras by --views")
    ground = Surfaces(scene)
    if not ground.textured_area.any():
        raise nothing
    random = np.random.default_rng(config.seed)
    extent = float((scene.bounds[1] - scene.bounds[0]).max())
    renderer = CandidateRenderer(draw_ids, config.size, scene)
    total = config.count * config.candidates_per_view
    walking, close = (math.ceil(total * share) for share in WALKING_AND_CLOSE_SHARES)
    places = CandidateSampler(ground, random, extent, config.fov_degrees)
    views = renderer.views([*places.walking(walking), *places.close(close)])
    around = orbit(scene, random, extent, max(total - walking - close, ORBITS_TRIED), config)
    views += renderer.views(around[:ORBITS_TRIED])
    # Views from outside are the slowest to render, and in a town show mostly the backs of houses.
    if sum(view.meets(CRITERIA[0]) for view in views) < ENOUGH * config.count:
        views += renderer.views(around[ORBITS_TRIED:])
    chosen = choose(views, renderer, config.count, len(scene.textures)) if views else []
    if not chosen:
        raise nothing
    return tuple(replace(one.camera, name=f"sampled_{number:02}") for number, one in enumerate(chosen, 1))
