"""Scene files whose coarse mips visibly differ from their fine ones: squares of fine detail in all maps, which fill the picture."""

import contextlib
import io
from pathlib import Path

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from tests.support.gltf_builder import GltfBuilder, png
from viewer import cli

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
SQUARE_UVS = np.array([[0, 1], [1, 1], [1, 0], [0, 1], [1, 0], [0, 0]], np.float32)
TOWARDS_CAMERA = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (6, 1))
SIDE = 256
"""Texels along a side of a texture: about 1.5 for each pixel of a window of 320x200."""
FIELD = 0.6
"""Vertical field of view of the scene's camera, radians."""
FINE, LARGE = 4, 32
"""Texels along a side of the squares of one colour that a texture is made of: the mips of 32 texels lack the fine ones."""
FINE_SHARE = 0.7
"""Of the contrast."""


def _detail(random: np.random.Generator, side: int, channels: int) -> NDArray[np.float64]:
    """[side, side, channels], 0 to 1: fine squares over large ones."""
    found = np.zeros((side, side, channels))
    for texels, share in ((FINE, FINE_SHARE), (LARGE, 1.0 - FINE_SHARE)):
        squares = random.random((-(-side // texels), -(-side // texels), channels))
        found += share * squares.repeat(texels, axis=0).repeat(texels, axis=1)[:side, :side]
    return found


def _bytes(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    found: NDArray[np.uint8] = np.clip(values * 255.0 + 0.5, 0, 255).astype(np.uint8)
    return found


def _normals(random: np.random.Generator, side: int) -> NDArray[np.uint8]:
    slopes = _detail(random, side, 2) - 0.5
    vectors = np.dstack([slopes[..., :2], np.ones((side, side))])
    return _bytes(vectors / np.linalg.norm(vectors, axis=2, keepdims=True) * 0.5 + 0.5)


def _material(builder: GltfBuilder, random: np.random.Generator, side: int, blend: bool) -> int:
    """A material with base colour, normals, occlusion, roughness, metalness and emission."""
    base = _bytes(_detail(random, side, 3))
    if blend:
        base = np.dstack([base, _bytes(0.2 + 0.6 * _detail(random, side, 1))])
    further = (_normals(random, side), _bytes(_detail(random, side, 3)), _bytes(0.5 * _detail(random, side, 3)))
    image = builder.image(png(base), name="base")
    normal, orm, emissive = (builder.add("textures", source=builder.image(png(pixels))) for pixels in further)
    return builder.material(
        image,
        pbr={"metallicRoughnessTexture": {"index": orm}},
        normalTexture={"index": normal},
        occlusionTexture={"index": orm},
        emissiveTexture={"index": emissive},
        emissiveFactor=[1.0, 1.0, 1.0],
        alphaMode="BLEND" if blend else "OPAQUE",
    )


def write_wall(
    path: Path,
    textures: int = 2,
    side: int = SIDE,
    blend: bool = False,
    animated: bool = False,
    seed: int = 1,
) -> Path:
    """A wall of squares that fills the view of its camera, each with another material; written to `path`.

    `blend`: a pane in front of it that lets a part of the light through. `animated`: a square turns, in the animation `turn`.
    """
    builder, random = GltfBuilder(), np.random.default_rng(seed)
    columns = -(-textures // 2) if textures > 2 else textures
    rows = -(-textures // columns)
    drawn = []
    for number in range(textures):
        corner = (number % columns - columns / 2, number // columns - rows / 2, 0.0)
        square = SQUARE + np.array(corner, np.float32)
        material = _material(builder, random, side, blend=False)
        drawn.append(builder.triangle(material, POSITION=square, TEXCOORD_0=SQUARE_UVS, NORMAL=TOWARDS_CAMERA))
    if blend:
        pane = SQUARE * 0.8 + np.array([-0.4, -0.4, 0.1], np.float32)
        material = _material(builder, random, side, blend=True)
        drawn.append(builder.triangle(material, POSITION=pane, TEXCOORD_0=SQUARE_UVS, NORMAL=TOWARDS_CAMERA))
    builder.drawn(*drawn)
    if animated:
        _add_turning_square(builder, random, side)
    camera = builder.add("cameras", type="perspective", perspective={"yfov": FIELD, "znear": 0.05, "zfar": 50.0})
    distance = 0.5 * rows / float(np.tan(FIELD / 2.0))
    builder.add("nodes", camera=camera, translation=[0.0, 0.0, distance])
    return builder.write(path)


def _add_turning_square(builder: GltfBuilder, random: np.random.Generator, side: int) -> None:
    material = _material(builder, random, side, blend=False)
    square = SQUARE * 0.5 - np.array([0.25, 0.25, 0.0], np.float32)
    mesh = builder.mesh(builder.triangle(material, POSITION=square, TEXCOORD_0=SQUARE_UVS, NORMAL=TOWARDS_CAMERA))
    node = builder.add("nodes", mesh=mesh, translation=[0.0, 0.0, 0.2])
    turns = np.array([[0, 0, 0, 1], [0, 0, 0.7071068, 0.7071068]], np.float32)
    sampler = {"input": builder.accessor(np.array([0.0, 2.0], np.float32)), "output": builder.accessor(turns)}
    channel = {"sampler": 0, "target": {"node": node, "path": "rotation"}}
    builder.add("animations", name="turn", samplers=[sampler], channels=[channel])


def encode(scene: Path, out: Path, *arguments: str) -> Path:
    """Write a pack of 4 bits per texel, or add it to a library; `arguments` follow those of the command. Raises RuntimeError."""
    command = ["encode", str(scene), "--out", str(out), "--codec", "block", "--bits", "4", *arguments]
    with contextlib.redirect_stdout(io.StringIO()) as printed, contextlib.redirect_stderr(printed):
        status = cli.main(command)
    if status != 0:
        raise RuntimeError(printed.getvalue())
    return out


def write_panorama(path: Path, seed: int = 3) -> Path:
    """An equirectangular .hdr of 128x64 texels with a bright and coloured half."""
    random = np.random.default_rng(seed)
    pixels = random.random((64, 128, 3)).astype(np.float32)
    pixels[:, :64] *= np.array([6.0, 2.0, 0.5], np.float32)
    output = OpenImageIO.ImageOutput.create(str(path))
    if output is None:
        raise RuntimeError(f"{path}: OpenImageIO writes no such file")
    if not (output.open(str(path), OpenImageIO.ImageSpec(128, 64, 3, "float")) and output.write_image(pixels)):
        raise RuntimeError(f"{path}: {output.geterror()}")
    output.close()
    return path
