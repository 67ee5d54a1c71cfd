"""Small scenes with known pictures: full-screen quads whose texture coordinates are an affine map of the pixel."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import MapName
from ntc.codec.textures import hash_pixels
from tests.support.gltf_builder import noise
from viewer.scene.bounds import world_bounds
from viewer.scene.model import (
    Camera,
    Geometry,
    Instances,
    LoadReport,
    Material,
    Primitive,
    Scene,
    SceneTexture,
)
from viewer.scene.pixels import PixelsInMemory

WHITE = (1.0, 1.0, 1.0, 1.0)
QUAD = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]], np.float32)
QUAD_UVS = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]], np.float32)
"""Row 0 of the image on top, as glTF has it."""
QUAD_INDICES = np.array([0, 1, 2, 0, 2, 3], np.uint32)
CUBE_CORNERS = np.array([[x, y, z] for z in (-1.0, 1.0) for y in (-1.0, 1.0) for x in (-1.0, 1.0)], np.float32)
CUBE_FACES = np.array([[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]])
IDENTITY = np.eye(4, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class Part:
    """Primitive with its placement."""

    material: int = 0
    positions: NDArray[np.float32] = field(default_factory=lambda: QUAD)
    """[V, 3]."""
    uvs: NDArray[np.float32] = field(default_factory=lambda: QUAD_UVS)
    """[V, 2]."""
    indices: NDArray[np.uint32] = field(default_factory=lambda: QUAD_INDICES)
    """[3 T]."""
    transforms: tuple[NDArray[np.floating], ...] = field(default_factory=lambda: (IDENTITY,))
    """[4, 4] each."""
    colors: NDArray[np.float32] | None = None
    """[V, 4] linear."""


def texture(width: int = 16, height: int = 16, seed: int = 0, alpha: NDArray[np.uint8] | None = None) -> SceneTexture:
    """A texture of random pixels."""
    return texture_of(noise(height, width, 3, seed), alpha)


def texture_of(pixels: NDArray[np.uint8], alpha: NDArray[np.uint8] | None = None) -> SceneTexture:
    """A texture of `pixels` [H, W, 3] sRGB."""
    digest = hash_pixels(pixels if alpha is None else np.dstack([pixels, alpha]))
    size = pixels.shape[1], pixels.shape[0]
    source = PixelsInMemory(pixels, alpha)
    return SceneTexture(f"texture {digest[:6]}", size, alpha is not None, digest, "test", source)


def as_set(
    texture: SceneTexture, maps: tuple[MapName, ...], further: Mapping[MapName, NDArray[np.uint8]], set_hash: str = ""
) -> SceneTexture:
    """`texture` with further maps."""
    source = PixelsInMemory(texture.pixels, texture.alpha, further)
    return replace(texture, maps=maps, source=source, set_hash=set_hash)


def scene_of(parts: Sequence[Part], materials: Sequence[Material], textures: Sequence[SceneTexture] = ()) -> Scene:
    """A Scene of these parts."""
    has_colors = any(part.colors is not None for part in parts)
    primitives, rows, transforms = [], [], []
    first_index = base_vertex = 0
    for number, part in enumerate(parts):
        primitives.append(
            Primitive(f"part {number}", first_index, len(part.indices), base_vertex, len(part.positions), part.material)
        )
        first_index, base_vertex = first_index + len(part.indices), base_vertex + len(part.positions)
        rows += [number] * len(part.transforms)
        transforms += [np.asarray(matrix, np.float32) for matrix in part.transforms]

    def joined(arrays: Sequence[NDArray[Any]], columns: int, dtype: type) -> NDArray[Any]:
        empty: NDArray[Any] = np.zeros((0, columns) if columns else 0, dtype)
        return np.concatenate([empty, *(np.asarray(array, dtype) for array in arrays)])

    colors = [np.ones((len(p.positions), 4), np.float32) if p.colors is None else p.colors for p in parts]
    geometry = Geometry(
        positions=joined([p.positions for p in parts], 3, np.float32),
        uvs=joined([p.uvs for p in parts], 2, np.float32),
        colors=joined(colors, 4, np.float32) if has_colors else None,
        indices=joined([p.indices for p in parts], 0, np.uint32),
    )
    instances = Instances(
        np.array(rows, np.int32),
        np.array(transforms, np.float32).reshape(-1, 4, 4),
        np.zeros(len(rows), np.int32),
    )
    bounds = world_bounds(geometry, primitives, instances) if rows else np.zeros((2, 3), np.float32)
    return Scene(
        "test",
        None,
        geometry,
        tuple(primitives),
        instances,
        tuple(materials),
        tuple(textures),
        (),
        ("node",),
        bounds,
        LoadReport(),
    )


def straight_camera(layer: int = 0) -> Camera:
    """An orthographic camera that looks along -Z at the quad of height 2 in the plane z = -layer, and at no other."""
    eye, target = (0.0, 0.0, 0.5 - layer), (0.0, 0.0, float(-layer))
    return Camera("straight", eye, target, orthographic_height=2.0, near=0.25, far=0.75)


@dataclass(frozen=True)
class PixelMap:
    """uv = origin + x * per_x + y * per_y for the pixel centre (x, y), y from the bottom, in pixels."""

    origin: tuple[float, float]
    per_x: tuple[float, float]
    per_y: tuple[float, float]

    def uv(self, size: tuple[int, int]) -> NDArray[np.float64]:
        """[H * W, 2] float64 of all pixels, row 0 on top."""
        x = np.tile(np.arange(size[0]) + 0.5, size[1])
        y = np.repeat(size[1] - np.arange(size[1]) - 0.5, size[0])
        return np.array(self.origin) + x[:, None] * np.array(self.per_x) + y[:, None] * np.array(self.per_y)

    def lod(self, texels: tuple[int, int]) -> float:
        """log2 of the longer side of a pixel's footprint on a texture of `texels` (width, height)."""
        sides = [np.hypot(side[0] * texels[0], side[1] * texels[1]) for side in (self.per_x, self.per_y)]
        return float(np.log2(max(sides)))

    def quad(self, size: tuple[int, int], material: int = 0, layer: int = 0) -> Part:
        """A quad that fills a picture of `size` (width, height) under `straight_camera(layer)` with this map."""
        aspect = size[0] / size[1]
        positions = QUAD * np.array([aspect, 1.0, 1.0], np.float32) - np.array([0.0, 0.0, layer], np.float32)
        corners = np.array([[0, 0], [size[0], 0], [size[0], size[1]], [0, size[1]]], np.float64)
        uvs = np.array(self.origin) + corners @ np.array([self.per_x, self.per_y])
        return Part(material, positions, uvs.astype(np.float32))


def cube(material: int, *transforms: NDArray[np.floating]) -> Part:
    """A cube from -1 to 1 with the whole texture on each face."""
    positions = CUBE_CORNERS[CUBE_FACES].reshape(-1, 3)
    indices = (np.arange(6, dtype=np.uint32)[:, None] * 4 + QUAD_INDICES).reshape(-1)
    return Part(material, positions, np.tile(QUAD_UVS, (6, 1)), indices, transforms or (IDENTITY,))


def sphere(material: int, *transforms: NDArray[np.floating], steps: int = 9) -> Part:
    """A unit sphere of 2 * steps * steps quads."""
    v, u = np.meshgrid(np.linspace(0.0, 1.0, steps + 1), np.linspace(0.0, 1.0, 2 * steps + 1), indexing="ij")
    polar, turn = v * np.pi, u * 2.0 * np.pi
    points = np.stack([np.sin(polar) * np.sin(turn), np.cos(polar), np.sin(polar) * np.cos(turn)], axis=-1)
    row = 2 * steps + 1
    corner = (np.arange(steps)[:, None] * row + np.arange(2 * steps)).reshape(-1, 1)
    quads = np.concatenate([corner + row, corner + row + 1, corner + 1, corner], axis=1)
    indices = quads[:, QUAD_INDICES].reshape(-1).astype(np.uint32)
    uvs = np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float32)
    return Part(material, points.reshape(-1, 3).astype(np.float32), uvs, indices, transforms or (IDENTITY,))


def placed(
    x: float = 0.0,
    y: float = 0.0,
    z: float = 0.0,
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
    turn: float = 0.0,
) -> NDArray[np.float32]:
    """[4, 4] transform: scaled, turned by `turn` degrees about Y, moved."""
    angle = np.radians(turn)
    rotation = np.array([[np.cos(angle), 0.0, np.sin(angle)], [0.0, 1.0, 0.0], [-np.sin(angle), 0.0, np.cos(angle)]])
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * np.array(scale)
    matrix[:3, 3] = (x, y, z)
    return matrix.astype(np.float32)
