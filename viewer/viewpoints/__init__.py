"""Viewpoints sampled in a scene without cameras: where a person would stand, and where an object is shown from."""

import math
from dataclasses import replace

import numpy as np

from ntc.errors import InputError
from viewer.scene.model import Camera, Scene
from viewer.viewpoints.candidates import Places, ViewpointConfig, orbit
from viewer.viewpoints.choice import RULES, Pictures, See, choose
from viewer.viewpoints.surfaces import Surfaces

__all__ = ["See", "ViewpointConfig", "sample_viewpoints"]

WALKING_AND_CLOSE_SHARES = (0.5, 0.3)
"""Shares of the candidates that walk, and that look closely; the others go around the scene."""
ORBITS_TRIED = 4
"""Views from around the scene that are drawn in any case; more only where there are fewer than..."""
ENOUGH = 2
"""... this many good views for each one asked for."""


def sample_viewpoints(scene: Scene, see: See, config: ViewpointConfig) -> tuple[Camera, ...]:
    """At most `config.count` cameras named "sampled_01" and so on, the most telling first; the same seed gives the same.

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
    pictures = Pictures(see, config.size, scene)
    total = config.count * config.candidates_per_view
    walking, close = (math.ceil(total * share) for share in WALKING_AND_CLOSE_SHARES)
    places = Places(ground, random, extent, config.fov_degrees)
    views = pictures.views([*places.walking(walking), *places.close(close)])
    around = orbit(scene, random, extent, max(total - walking - close, ORBITS_TRIED), config)
    views += pictures.views(around[:ORBITS_TRIED])
    # A town that can be walked in need not be seen from outside: that is the slowest to draw and shows the backs of it.
    if sum(view.fulfils(RULES[0]) for view in views) < ENOUGH * config.count:
        views += pictures.views(around[ORBITS_TRIED:])
    chosen = choose(views, pictures, config.count, len(scene.textures)) if views else []
    if not chosen:
        raise nothing
    return tuple(replace(one.camera, name=f"sampled_{number:02}") for number, one in enumerate(chosen, 1))
