"""Error of a decode path against the float64 codec at sampled pixels of a frame, located by the visibility buffer."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lab.bench.filtering import decode_filtered, filter_decoded
from ntc.codec.mips import linear_to_srgb, linear_to_srgb8, srgb_to_linear
from ntc.codec.model import Pack
from ntc.codec.quality import finite_or_none
from ntc.pack.match import PackMatch
from viewer.render.resources.layout import MATERIAL_SHIFT
from viewer.render.resources.visibility_buffer import VisibilityTarget
from viewer.scene.model import Scene
from viewer.state.view_state import FILTERED_PATHS, PathChoice

SAMPLES = 4096
"""Largest number of pixels of a frame that are decoded in float64."""
LEAST_FACTOR = 1e-3
"""Smallest factor of a compared channel. Material and vertex colours below it leave too little of the decoded value."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Float64Error:
    """Error of a picture against float64."""

    largest: float
    """Largest error of decoded values, in [0, 1] of the texture's colour space, before they are rounded to 8 bits."""
    psnr_db: float | None
    """PSNR of the same values, peak 1; None where all are equal."""
    largest_step: int
    """Largest error of the 8-bit sRGB picture, in steps."""
    pixels: int
    """Number of compared pixels."""


@dataclass(frozen=True, eq=False)
class Float64Pixels:
    """Sampled pixels of a frame, decoded in float64."""

    pixels: NDArray[np.int64]
    """[N] indices of pixels, row by row, row 0 on top."""
    decoded: Array
    """[N, 3] in [0, 1], in the texture's colour space; one channel is repeated."""
    factor: Array
    """[N, 3] linear factor of the decoded colour."""
    is_srgb: NDArray[np.bool_]
    """[N] whether `decoded` is encoded in sRGB."""

    @property
    def albedo(self) -> Array:
        """[N, 3] linear albedo."""
        linear = np.where(self.is_srgb[:, None], srgb_to_linear(self.decoded), self.decoded)
        return linear * self.factor

    def compare(self, shown: NDArray[np.float32]) -> Float64Error:
        """Return the error of `shown`, the linear albedo [H, W, 3] of a path."""
        albedo = shown.reshape(-1, 3)[self.pixels].astype(np.float64)
        steps = linear_to_srgb8(albedo).astype(int) - linear_to_srgb8(self.albedo).astype(int)
        known = self.factor >= LEAST_FACTOR
        linear = np.clip(albedo / np.where(known, self.factor, 1.0), 0.0, 1.0)
        values = np.where(self.is_srgb[:, None], linear_to_srgb(linear), linear)
        error = np.abs(values - self.decoded)[known]
        if error.size == 0:
            return Float64Error(0.0, None, 0, 0)
        square = float(np.mean(error**2))
        return Float64Error(
            largest=float(error.max()),
            psnr_db=finite_or_none(-10.0 * math.log10(square) if square > 0.0 else math.inf),
            largest_step=int(np.abs(steps).max()),
            pixels=len(self.pixels),
        )


def float64_pixels(
    visibility: VisibilityTarget,
    scene: Scene,
    pack: Pack,
    match: PackMatch,
    path: PathChoice = "deferred",
    samples: int = SAMPLES,
    seed: int = 0,
) -> Float64Pixels:
    """Return `samples` pixels of the frame in `visibility`, chosen by `seed` from those that show a texture of `pack`.

    `path` decides whether latents are filtered before decoding, or decoded texels are filtered (FILTERED_PATHS).
    """
    decode = filter_decoded if path in FILTERED_PATHS else decode_filtered
    words = visibility.words().reshape(-1, 4)
    texture = (words[:, 0] & np.uint32((1 << MATERIAL_SHIFT) - 1)).astype(np.int64) - 1
    in_pack = np.array([*match.texture_index, -1], np.int64)[texture]
    candidates = np.nonzero(in_pack >= 0)[0]
    random = np.random.default_rng(seed)
    pixels = candidates
    if len(candidates) > samples:
        pixels = np.sort(random.choice(candidates, samples, replace=False))
    words, in_pack = words[pixels], in_pack[pixels]
    material = (words[:, 0] >> np.uint32(MATERIAL_SHIFT)).astype(np.int64) - 1
    floats = np.ascontiguousarray(words[:, 1:]).view(np.float32).astype(np.float64)
    uv, footprint = floats[:, :2], floats[:, 2]
    factor = np.array([entry.factor[:3] for entry in scene.materials], np.float64).reshape(-1, 3)[material]
    colors = visibility.colors()
    if colors is not None:
        factor = factor * colors.reshape(-1, 3)[pixels]
    decoded = np.zeros((len(pixels), 3))
    for index, number in {(int(index), int(number)) for index, number in zip(in_pack, material, strict=True)}:
        these = np.nonzero((in_pack == index) & (material == number))[0]
        lod = np.log2(np.maximum(footprint[these] * pack.textures[index].width, 1e-10))
        values = decode(pack, index, uv[these], lod, scene.materials[number].sampler)
        decoded[these] = values[:, :3] if values.shape[1] >= 3 else values[:, :1]
    is_srgb = np.array([texture.color_space == "srgb" for texture in pack.textures], bool)[in_pack]
    return Float64Pixels(pixels, decoded, factor, is_srgb)
