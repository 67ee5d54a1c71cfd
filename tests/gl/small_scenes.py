"""Three small scenes with everything that decides which surface is seen, and cameras that look at them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lab.bench.random_pack import random_pack
from ntc.codec.model import Pack
from tests.support.picture_scenes import (
    WHITE,
    Part,
    cube,
    placed,
    scene_of,
    sphere,
    texture,
)
from viewer.scene.model import Camera, Material, Sampler, Scene, SceneTexture

FRONT = Camera("front", (1.5, 2.5, 7.0), (0.0, 0.3, 0.0), fov_degrees=50.0)
BEHIND = Camera("behind", (-3.0, 1.0, -6.0), (0.3, 0.2, 0.0), fov_degrees=50.0)
ABOVE = Camera("above", (0.0, 9.0, 0.0), (0.0, 0.0, 0.0), up=(0.3, 0.0, -1.0), fov_degrees=45.0)
FLAT = Camera("flat", (4.0, 3.0, 5.0), (0.0, 0.3, 0.0), orthographic_height=5.0)
INSIDE = Camera("inside", (0.1, 0.6, 0.05), (1.0, 0.5, -0.4), fov_degrees=80.0)
CAMERAS = (FRONT, BEHIND, ABOVE, FLAT, INSIDE)


def floor(material: int) -> Part:
    """A square of 12 x 12 below everything, its texture repeated."""
    part = Part(material, transforms=(np.array(FLOOR, np.float32),))
    return replace(part, uvs=part.uvs * 4.0 - 1.3)


FLOOR = [[6.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.2], [0.0, -6.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]


def objects() -> Scene:
    """Cubes, spheres, a floor and an object without a texture, in front of and inside one another."""
    parts = [
        floor(0),
        cube(1, placed(-1.8, 0.0, 0.5, turn=25.0), placed(2.2, -0.4, -1.0, (0.7, 0.8, 0.5), 70.0)),
        sphere(2, placed(0.6, 0.2, 0.8, (1.2, 1.2, 1.2)), placed(-1.0, 1.4, -1.0, (0.6, 1.4, 0.6), 10.0)),
        cube(3, placed(0.6, 1.0, 0.8, (0.9, 0.4, 0.9), 45.0)),
        sphere(4, placed(-2.6, -0.6, 2.0, (0.5, 0.5, 0.5)), steps=6),
    ]
    materials = [Material(f"m{index}", index, WHITE) for index in range(4)]
    materials.append(Material("plain", -1, (0.8, 0.2, 0.1, 1.0)))
    return scene_of(parts, materials, textures())


def mirrored() -> Scene:
    """Mirrored instances, single sheets seen from both sides, an inside-out box, and many instances of one cube."""
    ring = [
        placed(2.6 * np.cos(turn), -0.8, 2.6 * np.sin(turn), (0.3, 0.3, -0.3 if index % 2 else 0.3), 40.0 * index)
        for index, turn in enumerate(np.arange(12) * np.pi / 6.0)
    ]
    parts = [
        floor(0),
        cube(1, placed(-1.3, 0.2, 0.0, (-1.0, 1.0, 0.6), 30.0), placed(1.5, 0.0, 0.3, (0.6, -0.9, 0.6), -20.0)),
        Part(2, transforms=(placed(0.0, 0.6, 1.8, turn=15.0), placed(-0.4, 1.2, -1.8, (-0.8, 0.8, 1.0), 160.0))),
        Part(3, transforms=(placed(0.4, 0.7, -1.2, turn=200.0), placed(1.9, 1.2, 1.6, (1.0, -0.6, 1.0), -40.0))),
        cube(0, *ring),
        sphere(3, placed(0.0, 0.8, 0.0, (-0.7, 0.7, 0.7))),
    ]
    materials = [Material(f"m{index}", index, WHITE, double_sided=index == 2) for index in range(4)]
    return scene_of(parts, materials, textures())


def checkers(cells: int, side: int) -> NDArray[np.uint8]:
    """[side, side] alpha: a board of `cells` x `cells` squares, covered and not."""
    cell = np.arange(side) * cells // side
    return (((cell[:, None] + cell) % 2) * 255).astype(np.uint8)


def masks() -> Scene:
    """Sheets with holes: by texture, by factor and texture, by vertex alpha; wrapped and mirrored; before others."""
    fading = np.array([[1, 1, 1, 0], [1, 1, 1, 1], [1, 1, 1, 1], [1, 1, 1, 0]], np.float32)
    board = Part(1, transforms=(placed(0.0, 0.5, 1.5, (1.5, 1.5, 1.0)), placed(-1.6, 0.4, 0.0, turn=60.0)))
    folded = Part(2, transforms=(placed(1.6, 0.8, 0.4, (-1.0, 1.0, 1.0), -30.0),))
    parts = [
        floor(0),
        cube(3, placed(0.0, 0.0, -0.6)),
        replace(board, uvs=board.uvs * 1.5 - 0.25),
        replace(folded, uvs=folded.uvs * 2.0 - 1.0),
        Part(4, transforms=(placed(0.2, 0.4, 2.4, (0.8, 0.5, 1.0)),), colors=fading),
    ]
    materials = [
        Material("floor", 0, WHITE),
        Material("board", 1, WHITE, alpha_mode="mask"),
        Material("folded", 2, (1.0, 1.0, 1.0, 0.6), Sampler(("mirror", "repeat")), "mask", 0.3, double_sided=True),
        Material("box", 3, WHITE),
        Material("fading", -1, WHITE, alpha_mode="mask", alpha_cutoff=0.4, double_sided=True),
    ]
    images = list(textures())
    images[1] = texture(64, 64, 21, checkers(4, 64))
    images[2] = texture(64, 64, 22, checkers(2, 64))
    return scene_of(parts, materials, images)


def textures() -> list[SceneTexture]:
    """Four textures of different sizes."""
    return [texture(64, 64, 10), texture(64, 32, 11), texture(40, 24, 12), texture(17, 33, 13)]


def pack_of(scene: Scene, side: int | None = None, groups: tuple[int, ...] | None = None, seed: int = 0) -> Pack:
    """A pack of codec `grid`: textures of the scene's sizes or of `side` texels a side, by turns in two groups."""
    sizes = [(side or image.pixels.shape[1], side or image.pixels.shape[0]) for image in scene.textures]
    groups = groups or tuple(number % 2 for number in range(len(sizes)))
    return random_pack(sizes, groups, hashes=[image.pixel_hash for image in scene.textures], seed=seed)


SCENES = {"objects": objects, "mirrored": mirrored, "masks": masks}
