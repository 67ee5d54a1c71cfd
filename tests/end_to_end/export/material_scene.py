"""A small scene of whole materials for tests of exporters."""

from typing import Any

import numpy as np

from tests.end_to_end.conftest import SQUARE, SQUARE_UVS
from tests.support.gltf_builder import GltfBuilder, png


def waves(phase: int, side: int = 32) -> np.ndarray:
    """[side, side, 3] uint8: smooth, as photographs are."""
    y, x = np.mgrid[0:side, 0:side]
    channels = [np.sin(x * 0.3 * (number + 1) + y * 0.2 + phase) * 40.0 + 128.0 for number in range(3)]
    return np.stack(channels, axis=-1).astype(np.uint8)


def materials_scene(side: int = 32) -> GltfBuilder:
    """Textures of `side` x `side` texels: a whole material whose occlusion lies in the image of roughness and metalness, a base colour
    alone, and one with coverage."""
    builder, primitives = GltfBuilder(), []
    for number in range(3):
        pixels = waves(number, side)
        if number == 2:
            pixels = np.dstack([pixels, pixels[..., 1]])
        pbr: dict[str, Any] = {
            "baseColorTexture": {
                "index": builder.add("textures", source=builder.image(png(pixels), name=f"base {number}"))
            }
        }
        more: dict[str, Any] = {"alphaMode": "MASK"} if number == 2 else {}
        if number == 0:
            orm = builder.add("textures", source=builder.image(png(waves(7, side)), name="orm"))
            tilted = waves(8, side)
            tilted[..., 2] = 240
            normal = builder.add("textures", source=builder.image(png(tilted), name="bumps"))
            pbr["metallicRoughnessTexture"] = {"index": orm}
            more = {"occlusionTexture": {"index": orm}, "normalTexture": {"index": normal}}
        position = SQUARE + np.array([number - 1.5, -0.5, 0], np.float32)
        material = builder.material(pbr=pbr, **more)
        primitives.append(builder.triangle(material, POSITION=position, TEXCOORD_0=SQUARE_UVS))
    builder.drawn(*primitives)
    # Viewers without a scene of their own choosing show none.
    builder.add("scenes", nodes=[0])
    return builder
