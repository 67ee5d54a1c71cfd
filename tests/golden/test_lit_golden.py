"""Lit spheres look as they did when somebody last looked.

`python -m tests.golden.test_lit_golden` draws them anew. Look at them before committing.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.mips import linear_to_srgb8
from tests.support.lit_studio import LitStudio, Planes, sphere_grid
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.scene.images import read_image, write_png
from viewer.scene.model import SurfaceFactors
from viewer.state.view_state import Lighting

FOLDER = Path(__file__).parent / "llvmpipe" / "lit"
SIZE = (240, 150)
TOLERANCE = 2
"""Of 255: skies are made with numpy, whose functions round differently from processor to processor."""
ALLOWED_SHARE = 0.002

GRID = [[SurfaceFactors(roughness=r, metalness=m) for r in (0.0, 0.25, 0.5, 0.75, 1.0)] for m in (1.0, 0.5, 0.0)]
COATS = [
    [SurfaceFactors(roughness=0.8, metalness=1.0, clearcoat=c, clearcoat_roughness=0.1) for c in (0.0, 0.5, 1.0)],
    [SurfaceFactors(roughness=0.3, metalness=0.0, ior=ior) for ior in (1.0, 1.5, 2.4)],
]


def plain(_studio: LitStudio) -> Planes:
    """Neutral maps."""
    return {}


def bumps(studio: LitStudio) -> Planes:
    """Round bumps along the picture, brown rust between them, and a glowing stripe."""
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]].astype(np.float32)
    waves = np.stack([np.sin(x * 0.9), np.sin(y * 0.9)], axis=-1) * 0.25 + 0.5
    rust = (np.sin(x * 0.21) * np.sin(y * 0.23) > 0.2).astype(np.float32)
    surface = np.concatenate([waves, np.stack([0.25 + 0.6 * rust, 1.0 - rust], axis=-1)], axis=-1)
    stripe = (np.abs(x - SIZE[0] / 2) < 4).astype(np.float32)
    emission = np.stack([stripe, stripe * 0.4, stripe * 0.1, 1.0 - 0.5 * rust], axis=-1)
    return {"surface": surface.astype(np.float32), "emission": emission}


PICTURES: dict[str, tuple[list[list[SurfaceFactors]], Lighting, Callable[[LitStudio], Planes]]] = {
    "grid.noon": (GRID, Lighting(sun_azimuth=140.0, sun_elevation=50.0), plain),
    "grid.evening-agx": (GRID, Lighting(sun_azimuth=60.0, sun_elevation=6.0, exposure=0.5, tone_map="agx"), plain),
    "coats": (COATS, Lighting(sun_azimuth=200.0, sun_elevation=30.0), plain),
    "bumps": (
        [[SurfaceFactors(emissive=(2.0, 2.0, 2.0))] * 3] * 2,
        Lighting(sun_azimuth=120.0, sun_elevation=35.0),
        bumps,
    ),
}


def drawn(context: GraphicsContext, name: str) -> NDArray[np.uint8]:
    """[H, W, 3] sRGB of one of PICTURES."""
    factors, lighting, planes = PICTURES[name]
    spheres = sphere_grid(factors, (0.9, 0.62, 0.35), steps=32)
    studio = LitStudio(context, spheres.scene, spheres.camera, SIZE)
    given = studio.planes({"base": studio.factor_base(), **planes(studio)})
    picture = linear_to_srgb8(studio.draw(given, light=studio.light_drawer.prepare(lighting)))
    studio.release()
    return picture


@pytest.mark.parametrize("name", PICTURES)
def test_lit_spheres_are_as_accepted(name: str) -> None:
    context = create_headless_context()
    picture = drawn(context, name)
    renderer = context.info.renderer
    context.gl.release()
    assert picture.std() > 5.0
    if "llvmpipe" not in renderer:
        pytest.skip(f"accepted pictures are from llvmpipe, this is {renderer}")
    accepted = read_image(FOLDER / f"{name}.png")
    apart = np.abs(picture.astype(int) - accepted.astype(int)).max(axis=-1)
    assert float((apart > TOLERANCE).mean()) <= ALLOWED_SHARE


def main() -> None:
    """Replace the accepted pictures by new ones."""
    context = create_headless_context()
    for name in PICTURES:
        write_png(FOLDER / f"{name}.png", drawn(context, name))
    context.gl.release()


if __name__ == "__main__":
    main()
