"""The channels that a material reads of an image as one of its maps, normals brought to unit length."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import MapName
from ntc.codec.textures import hash_pixels
from viewer.scene.images import is_constant
from viewer.scene.pixels.image_facts import MapFacts

CHANNELS: dict[MapName, tuple[int, ...]] = {
    "normal": (0, 1),
    "roughness": (1,),
    "metalness": (2,),
    "emissive": (0, 1, 2),
    "occlusion": (0,),
}
"""Where glTF 2.0, Sec. 3.9 keeps each map among the channels of its image."""
FLAT = ((127, 127), (127, 128), (128, 127), (128, 128))
"""Normal xy that stand for an even surface: 0 lies between two of 256 steps."""
MIDDLE = 127.5
SHORTEST, LONGEST = 0.9, 1.1
"""Lengths of stored normals beyond rounding: others are brought to 1 before z is dropped."""
ROWS = 256
"""Rows of an image that are looked at together."""


def _unit_normals(image: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], int]:
    """(xy [H, W, 2] of the normals in `image` [H, W, 3 or 4], texels whose normal was far from unit length; those that also point
    into the surface become even).

    Renderers normalise what they sample (glTF 2.0, Sec. 3.9); z is rebuilt from xy here, so xy must be those of the unit
    normal. Where blue is the same everywhere the image holds xy alone.
    """
    normal = np.ascontiguousarray(image[..., :2])
    blue = image[..., 2]
    if bool((blue == blue[0, 0]).all()):
        return normal, 0
    changed = 0
    for start in range(0, len(image), ROWS):
        vectors = (image[start : start + ROWS, :, :3].astype(np.float32) - np.float32(MIDDLE)) / np.float32(MIDDLE)
        lengths = np.sqrt(np.einsum("hwc,hwc->hw", vectors, vectors))
        far = ((lengths < SHORTEST) | (lengths > LONGEST)) & (lengths > 0.05)
        count = int(far.sum())
        if count:
            changed += count
            unit = vectors[far][:, :2] / lengths[far][:, None]
            # Black texels, which no triangle shows, are common.
            unit[vectors[far][:, 2] < 0] = 0.0
            normal[start : start + ROWS][far] = np.floor(unit * MIDDLE + MIDDLE + 0.5).astype(np.uint8)
    return normal, changed


def map_channels(name: MapName, image: NDArray[np.uint8]) -> tuple[NDArray[np.uint8] | None, str]:
    """([H, W, channels] of map `name` of `image` [H, W, 3 or 4] uint8, or None where that is not usable; what was wrong with it)."""
    if name != "normal":
        channels = CHANNELS[name]
        return np.ascontiguousarray(image[..., channels[0] : channels[-1] + 1]), ""
    if not is_constant(image[..., :3]) and all(bool((image[..., k] == image[..., 0]).all()) for k in (1, 2)):
        return None, "is grey, no normals are in it; left out"
    pixels, changed = _unit_normals(image)
    if not changed:
        return pixels, ""
    share = 100.0 * changed / (pixels.shape[0] * pixels.shape[1])
    return pixels, f"has normals far from unit length, which were normalised: {share:.3g} % of its texels"


def map_facts(name: MapName, pixels: NDArray[np.uint8] | None, remark: str) -> MapFacts:
    """What there is to know of what `map_channels` gives."""
    if pixels is None:
        return MapFacts(remark=remark)
    if not is_constant(pixels):
        return MapFacts(hash_pixels(pixels), None, remark)
    constant = tuple(int(value) for value in pixels[0, 0])
    if name == "normal" and constant not in FLAT:
        return MapFacts(remark="has one normal that is not upright; left out")
    return MapFacts(constant=constant, remark=remark)


def resampled(pixels: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """[height, width, C] uint8: `pixels` [H, W, C] sampled bilinearly at texel centres, clamped at the borders."""
    for axis, size in ((0, height), (1, width)):
        count = pixels.shape[axis]
        if count == size:
            continue
        at = np.clip((np.arange(size) + 0.5) * (count / size) - 0.5, 0.0, count - 1.0)
        low = np.floor(at).astype(np.int64)
        share = (at - low).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        lower, upper = pixels.take(low, axis), pixels.take(np.minimum(low + 1, count - 1), axis)
        pixels = np.floor(lower + share * (upper.astype(np.float32) - lower) + np.float32(0.5)).astype(np.uint8)
    return pixels
