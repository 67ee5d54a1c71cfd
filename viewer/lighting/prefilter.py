"""An environment as the shading reads it, in float64: the twin of shaders/passes/prefilter.

Specular reflections read octahedral maps, each the environment convolved with GGX at one roughness; the diffuse one reads nine
spherical harmonics (Ramamoorthi and Hanrahan 2001, "An Efficient Representation for Irradiance Environment Maps").
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from viewer.lighting.brdf import half_vectors, hammersley, normalized
from viewer.lighting.directions import (
    Array,
    octahedral_coordinates,
    octahedral_directions,
    panorama_coordinates,
    panorama_directions,
    panorama_solid_angles,
)
from viewer.lighting.panorama import reduced

ENVIRONMENT_LEVELS: Final = 7
"""Roughnesses from 0 to 1 that an environment is prefiltered for."""
MOST_SAMPLES: Final = 256
IRRADIANCE_WIDTH: Final = 256
"""Texels across of the panorama that irradiance is integrated over."""


@dataclass(frozen=True)
class PrefilterSize:
    """How finely an environment is prefiltered."""

    sides: tuple[int, ...]
    """Of the octahedral map of each roughness from 0 to 1 in equal steps, in texels, borders left out. The first shows the
    environment itself, and is the source of the others: a power of 2."""
    samples: int
    """Directions that each texel is the mean of."""

    @property
    def tiles(self) -> tuple[tuple[int, int], ...]:
        """(left, top) of each map in their common texture, of its border."""
        places, top = [(0, 0)], 0
        for side in self.sides[1:]:
            places.append((self.sides[0] + 2, top))
            top += side + 2
        return tuple(places)

    @property
    def texture_size(self) -> tuple[int, int]:
        """(width, height) of that texture."""
        return self.sides[0] + self.sides[1] + 4, max(self.sides[0] + 2, sum(side + 2 for side in self.sides[1:]))


SKY_SIZE: Final = PrefilterSize((128, 64, 32, 32, 16, 16, 16), 32)
"""Of the sky: smooth, and prefiltered again when the sun moves."""
PANORAMA_SIZE: Final = PrefilterSize((512, 128, 64, 64, 32, 32, 32), 256)


def irradiance_harmonics(panorama: NDArray[np.float32]) -> Array:
    """[9, 3] factors of 1, y, z, x, xy, yz, 3zz-1, xz, xx-yy of a normal: their sum is the irradiance over pi.

    `panorama`: [H, 2 H, 3] linear radiance, equirectangular.
    """
    pixels = reduced(panorama, IRRADIANCE_WIDTH)
    height = pixels.shape[0]
    directions, solid_angles = panorama_directions(height), panorama_solid_angles(height)
    integral = np.zeros((9, 3))
    for row in range(height):
        integral += solid_angles[row] * (_harmonics(directions[row]).T @ pixels[row].astype(np.float64))
    # Squares of the constants that make the basis orthonormal, times the cosine lobe's factors 1, 2/3, 1/4.
    squares = np.array([0.282095, *[0.488603] * 3, *[1.092548] * 2, 0.315392, 1.092548, 0.546274]) ** 2
    lobe = np.array([1.0, *[2.0 / 3.0] * 3, *[0.25] * 5])
    return np.asarray(integral * (squares * lobe)[:, None])


def _harmonics(normals: Array) -> Array:
    x, y, z = np.moveaxis(normals, -1, 0)
    terms = [np.ones_like(x), y, z, x, x * y, y * z, 3.0 * z * z - 1.0, x * z, x * x - y * y]
    return np.stack(terms, axis=-1)


def irradiance(harmonics: Array, normals: Array) -> Array:
    """[N, 3] irradiance over pi around unit `normals` [N, 3], at least 0."""
    return np.asarray(np.maximum(_harmonics(normals) @ harmonics, 0.0))


def sample_bilinear(image: Array, x: Array, y: Array, repeat_x: bool = False) -> Array:
    """[..., C] of `image` [H, W, C] at texel coordinates (0.5: the first centre), clamped at its edges, or around along x."""
    height, width = image.shape[:2]
    x, y = x - 0.5, y - 0.5
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    across, down = (x - left)[..., None], (y - top)[..., None]
    columns = [(left + step) % width if repeat_x else np.clip(left + step, 0, width - 1) for step in (0, 1)]
    rows = [np.clip(top + step, 0, height - 1) for step in (0, 1)]
    upper, lower = (image[row, columns[0]] * (1.0 - across) + image[row, columns[1]] * across for row in rows)
    return np.asarray(upper * (1.0 - down) + lower * down)


def sample_panorama(panorama: Array, directions: Array) -> Array:
    """[..., 3] radiance of a panorama [H, 2 H, 3] in `directions` [..., 3], filtered bilinearly."""
    places = panorama_coordinates(directions)
    height, width = panorama.shape[:2]
    return sample_bilinear(panorama, places[..., 0] * width, places[..., 1] * height, repeat_x=True)


def source_samples(panorama_width: int, side: int) -> int:
    """Places along each side of a texel of the first octahedral map that the panorama is read at."""
    return min(max(-(-panorama_width // (2 * side)), 1), 8)


def octahedral_source(panorama: Array, side: int) -> Array:
    """[side, side, 3]: `panorama` [H, 2 H, 3] as an octahedral map."""
    steps = source_samples(panorama.shape[1], side)
    places = (np.arange(side * steps) + 0.5) / (side * steps)
    columns, rows = np.meshgrid(places, places)
    fine = sample_panorama(panorama, octahedral_directions(np.stack([columns, rows], axis=-1)))
    return np.asarray(fine.reshape(side, steps, side, steps, 3).mean(axis=(1, 3)))


def mip_chain(image: Array) -> list[Array]:
    """`image` [S, S, C] and its halves as means of four texels; S is a power of 2."""
    chain = [image]
    while chain[-1].shape[0] > 1:
        half = chain[-1].shape[0] // 2
        chain.append(chain[-1].reshape(half, 2, half, 2, -1).mean(axis=(1, 3)))
    return chain


def around(axis: Array, local: Array) -> Array:
    """Vectors `local` [..., 3] around (0, 0, 1) turned around unit vectors `axis` [..., 3] (Duff et al. 2017, "Building an
    Orthonormal Basis, Revisited")."""
    x, y, z = np.moveaxis(axis, -1, 0)
    sign = np.where(z >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=-1)
    second = np.stack([b, sign + y * y * a, -y], axis=-1)
    return np.asarray(local[..., :1] * first + local[..., 1:2] * second + local[..., 2:] * axis)


def _sample_chain(chain: list[Array], directions: Array, lod: Array) -> Array:
    places = octahedral_coordinates(directions)
    lod = np.clip(lod, 0.0, len(chain) - 1.0)
    result = np.zeros((*directions.shape[:-1], 3))
    for level, image in enumerate(chain):
        weight = np.maximum(1.0 - np.abs(lod - level), 0.0)[..., None]
        if weight.any():
            size = image.shape[0]
            result += weight * sample_bilinear(image, places[..., 0] * size, places[..., 1] * size)
    return result


def lobe_samples(roughness: float, samples: int, source_side: int) -> Array:
    """[n, 4]: directions around (0, 0, 1), whose z are their weights, and the level of the octahedral source that each reads.

    Drawn from GGX for a surface seen along its normal; those below it are left out. Each reads about the solid angle that it stands
    for. Krivanek and Colbert 2008, "Real-time Shading with Filtered Importance Sampling".
    """
    if roughness == 0.0:
        return np.array([[0.0, 0.0, 1.0, 0.0]])
    alpha = np.array(roughness**2)
    halves = half_vectors(hammersley(samples), alpha)
    cosine = halves[:, 2]
    lights = 2.0 * cosine[:, None] * halves - [0.0, 0.0, 1.0]
    density = alpha**2 / (4.0 * np.pi * (cosine**2 * (alpha**2 - 1.0) + 1.0) ** 2)
    texel = 4.0 * np.pi / source_side**2
    lods = np.maximum(0.5 * np.log2(1.0 / (samples * density * texel)) + 1.0, 0.0)
    return np.asarray(np.concatenate([lights, lods[:, None]], axis=1)[lights[:, 2] > 0.0])


def prefiltered(chain: list[Array], directions: Array, roughness: float, samples: int) -> Array:
    """[N, 3] means of radiance around `directions` [N, 3] under GGX, by `lobe_samples`."""
    lobe = lobe_samples(roughness, samples, chain[0].shape[0])
    total = np.zeros(directions.shape)
    for x, y, z, lod in lobe:
        light = around(directions, np.array([x, y, z]))
        total += z * _sample_chain(chain, light, np.full(directions.shape[:-1], lod))
    return np.asarray(total / lobe[:, 2].sum())


@dataclass(frozen=True, eq=False)
class PrefilteredEnvironment:
    """What the shading reads of an environment."""

    size: PrefilterSize
    maps: Array
    """[H, W, 3] the octahedral maps of all roughnesses in their places, each with a border of one texel."""
    harmonics: Array
    """[9, 3], see `irradiance_harmonics`."""

    def specular(self, directions: Array, roughness: Array) -> Array:
        """[N, 3] prefiltered radiance in unit `directions` [N, 3] at `roughness` [N, 1]: two maps, each filtered bilinearly."""
        places = octahedral_coordinates(normalized(directions))
        level = np.clip(roughness[:, 0], 0.0, 1.0) * (len(self.size.sides) - 1)
        result = np.zeros((len(places), 3))
        for number, (side, (left, top)) in enumerate(zip(self.size.sides, self.size.tiles, strict=True)):
            weight = np.maximum(1.0 - np.abs(level - number), 0.0)[:, None]
            x, y = left + 1.0 + places[:, 0] * side, top + 1.0 + places[:, 1] * side
            result += weight * sample_bilinear(self.maps, x, y)
        return result


def prefilter(panorama: NDArray[np.float32], size: PrefilterSize) -> PrefilteredEnvironment:
    """Prefilter a panorama [H, 2 H, 3], slowly."""
    chain = mip_chain(octahedral_source(panorama.astype(np.float64), size.sides[0]))
    width, height = size.texture_size
    maps = np.zeros((height, width, 3))
    for level, (side, (left, top)) in enumerate(zip(size.sides, size.tiles, strict=True)):
        places = (np.arange(-1, side + 1) + 0.5) / side
        columns, rows = np.meshgrid(places, places)
        directions = octahedral_directions(np.stack([columns, rows], axis=-1)).reshape(-1, 3)
        found = prefiltered(chain, directions, level / (len(size.sides) - 1), size.samples)
        maps[top : top + side + 2, left : left + side + 2] = found.reshape(side + 2, side + 2, 3)
    return PrefilteredEnvironment(size, maps, irradiance_harmonics(panorama))
