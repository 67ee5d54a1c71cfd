"""Prefiltered environments in float64: the twin of shaders/passes/prefilter.

The specular reflection reads cube maps of 7 roughnesses. Each is the environment convolved with GGX at its roughness (split sum, Karis
2013): a shader cannot integrate a lobe per pixel. The diffuse reflection reads a cube map of irradiance. Maps are cubes because coarse
octahedral maps show the creases of their mapping.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from viewer.lighting.brdf import half_vectors, hammersley, normalized
from viewer.lighting.directions import (
    Array,
    cube_coordinates,
    cube_directions,
    octahedral_coordinates,
    octahedral_directions,
    panorama_coordinates,
    panorama_solid_angles,
    sample_bilinear,
)

ENVIRONMENT_LEVELS: Final = 7
"""Number of roughnesses from 0 to 1 for which an environment is prefiltered."""
MOST_SAMPLES: Final = 256
IRRADIANCE_ROWS: Final = 64
"""Number of rows of the blocks of directions over which irradiance is integrated; there are twice as many columns."""


@dataclass(frozen=True)
class PrefilterSize:
    """Sizes of the maps of a prefiltered environment."""

    source_side: int
    """Side in texels of the octahedral map of the environment, the source of all other maps: a power of 2."""
    sides: tuple[int, ...]
    """Sides in texels of the faces of the cube maps, without borders. Map i has roughness i / (number of maps - 1)."""
    samples: int
    """Number of directions that are averaged for each texel."""
    irradiance_side: int
    """Side in texels of a face of the cube map of irradiance, without borders."""

    @property
    def all_sides(self) -> tuple[int, ...]:
        """Sides of the faces of all maps, that of irradiance last."""
        return (*self.sides, self.irradiance_side)

    @property
    def tops(self) -> tuple[int, ...]:
        """First rows of the maps in their common texture, where the faces of a map lie side by side."""
        return tuple(sum(side + 2 for side in self.all_sides[:level]) for level in range(len(self.all_sides)))

    @property
    def texture_size(self) -> tuple[int, int]:
        """(width, height) in texels of the common texture of all maps."""
        return 6 * (max(self.all_sides) + 2), sum(side + 2 for side in self.all_sides)


SKY_SIZE: Final = PrefilterSize(128, (64, 32, 16, 16, 8, 8, 8), 32, 8)
"""Size of the sky's maps: smooth, and prefiltered again when the sun moves."""
PANORAMA_SIZE: Final = PrefilterSize(512, (256, 64, 32, 32, 16, 16, 16), 256, 16)


def irradiance_map(panorama: NDArray[np.float32], side: int) -> Array:
    """Return [side + 2, 6, side + 2, 3] irradiance over pi of surfaces that face the directions of `cube_directions`.

    `panorama`: [H, 2 H, 3] linear radiance, equirectangular.

    Irradiance over pi is the integral of radiance times max(cosine, 0) / pi. It is computed as a sum over the whole panorama, because
    random samples could miss a small sun. Blocks of texels keep the sum short: the light of a block (radiance times solid angle) is
    added up, and comes from the mean direction of its texels, weighted by brightness.
    """
    height = panorama.shape[0]
    rows = min(IRRADIANCE_ROWS, -(-height // 4))
    down, across = np.arange(rows) * height // rows, np.arange(2 * rows) * height // rows

    def in_blocks(texels: NDArray[np.float32]) -> Array:
        along = np.add.reduceat(texels, across, axis=1, dtype=np.float64)
        return np.asarray(np.add.reduceat(along, down, axis=0).reshape(2 * rows * rows, -1))

    light = panorama * panorama_solid_angles(height)[:, None, None].astype(np.float32)
    # The small term gives blocks without light a direction too.
    brightness = light.sum(axis=2) + np.float32(1e-12)
    elevation = ((0.5 - (np.arange(height) + 0.5) / height) * np.pi).astype(np.float32)[:, None]
    azimuth = (((np.arange(2 * height) + 0.5) / height - 1.0) * np.pi).astype(np.float32)
    flat = brightness * np.cos(elevation)
    parts = flat * np.sin(azimuth), brightness * np.sin(elevation), flat * -np.cos(azimuth)
    towards = normalized(np.concatenate([in_blocks(part) for part in parts], axis=1))
    cosines = np.maximum(cube_directions(side).reshape(-1, 3) @ towards.T, 0.0)
    return np.asarray((cosines @ in_blocks(light) / np.pi).reshape(side + 2, 6, side + 2, 3))


def sample_panorama(panorama: Array, directions: Array) -> Array:
    """Return [..., 3] radiance of a panorama [H, 2 H, 3] in `directions` [..., 3], filtered bilinearly."""
    places = panorama_coordinates(directions)
    height, width = panorama.shape[:2]
    return sample_bilinear(panorama, places[..., 0] * width, places[..., 1] * height, repeat_x=True)


def source_samples(panorama_width: int, side: int) -> int:
    """Return the number of samples of the panorama along each side of a texel of the octahedral map."""
    return min(max(-(-panorama_width // (2 * side)), 1), 8)


def octahedral_source(panorama: Array, side: int) -> Array:
    """Return `panorama` [H, 2 H, 3] as an octahedral map [side, side, 3]."""
    steps = source_samples(panorama.shape[1], side)
    places = (np.arange(side * steps) + 0.5) / (side * steps)
    columns, rows = np.meshgrid(places, places)
    fine = sample_panorama(panorama, octahedral_directions(np.stack([columns, rows], axis=-1)))
    return np.asarray(fine.reshape(side, steps, side, steps, 3).mean(axis=(1, 3)))


def mip_chain(image: Array) -> list[Array]:
    """Return `image` [S, S, C] and its halves as means of four texels; S is a power of 2."""
    chain = [image]
    while chain[-1].shape[0] > 1:
        half = chain[-1].shape[0] // 2
        chain.append(chain[-1].reshape(half, 2, half, 2, -1).mean(axis=(1, 3)))
    return chain


def around(axis: Array, local: Array) -> Array:
    """Turn vectors `local` [..., 3] around (0, 0, 1) to lie around unit vectors `axis` [..., 3] (Duff et al. 2017, "Building an
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
    """Return [n, 4]: samples of a GGX lobe, each a direction around (0, 0, 1) and a mip level of the octahedral source.

    Filtered importance sampling (Krivanek and Colbert 2008, "Real-time Shading with Filtered Importance Sampling"): directions are
    drawn from GGX for a surface seen along its normal, and those below the surface are left out. The weight of a sample is its z. Few
    samples would show as noise. Therefore each reads a mip, one level coarser than that whose texels cover 1 / (samples * density).
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
    """Return [N, 3] means of the radiance around `directions` [N, 3], weighted by GGX with `lobe_samples`."""
    lobe = lobe_samples(roughness, samples, chain[0].shape[0])
    total = np.zeros(directions.shape)
    for x, y, z, lod in lobe:
        light = around(directions, np.array([x, y, z]))
        total += z * _sample_chain(chain, light, np.full(directions.shape[:-1], lod))
    return np.asarray(total / lobe[:, 2].sum())


@dataclass(frozen=True, eq=False)
class PrefilteredEnvironment:
    """Prefiltered environment: cube maps of radiance by roughness, and one of irradiance."""

    size: PrefilterSize
    maps: Array
    """[H, W, 3] common texture of the cube maps (`PrefilterSize.tops`); each face has a border of one texel."""

    def specular(self, directions: Array, roughness: Array) -> Array:
        """Return [N, 3] prefiltered radiance in unit `directions` [N, 3] at `roughness` [N, 1], interpolated between two maps."""
        level = np.clip(roughness[:, 0], 0.0, 1.0) * (len(self.size.sides) - 1)
        result = np.zeros((len(directions), 3))
        for number in range(len(self.size.sides)):
            weight = np.maximum(1.0 - np.abs(level - number), 0.0)[:, None]
            result += weight * self._sample(number, directions)
        return result

    def irradiance(self, normals: Array) -> Array:
        """Return [N, 3] irradiance over pi around unit `normals` [N, 3]."""
        return self._sample(len(self.size.sides), normals)

    def _sample(self, level: int, directions: Array) -> Array:
        faces, places = cube_coordinates(directions)
        side = self.size.all_sides[level]
        left = 1.0 + faces * (side + 2)
        return sample_bilinear(self.maps, left + places[:, 0] * side, self.size.tops[level] + 1.0 + places[:, 1] * side)


def prefilter(panorama: NDArray[np.float32], size: PrefilterSize) -> PrefilteredEnvironment:
    """Prefilter a panorama [H, 2 H, 3] of linear radiance, as the GPU does, but slowly."""
    chain = mip_chain(octahedral_source(panorama.astype(np.float64), size.source_side))
    width, height = size.texture_size
    maps = np.zeros((height, width, 3))
    for level, side in enumerate(size.all_sides):
        if level < len(size.sides):
            directions = cube_directions(side).reshape(-1, 3)
            faces = prefiltered(chain, directions, level / (len(size.sides) - 1), size.samples)
        else:
            faces = irradiance_map(panorama, side)
        top = size.tops[level]
        maps[top : top + side + 2, : 6 * (side + 2)] = faces.reshape(side + 2, 6 * (side + 2), 3)
    return PrefilteredEnvironment(size, maps)
