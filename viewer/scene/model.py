"""A loaded scene: plain, immutable numpy data. Axes and units are glTF's (Y up, right-handed, metres)."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import WrapMode

AlphaMode = Literal["opaque", "mask", "blend"]


@dataclass(frozen=True)
class Sampler:
    """How a material samples its texture (glTF sampler)."""

    wrap: tuple[WrapMode, WrapMode] = ("repeat", "repeat")
    """Along u and v."""
    magnify_linear: bool = True
    minify_linear: bool = True
    mipmap: Literal["none", "nearest", "linear"] = "linear"


@dataclass(frozen=True, eq=False)
class SceneTexture:
    """One distinct image of the scene; its index in `Scene.textures` is its texture id. Never a constant image."""

    name: str
    pixels: NDArray[np.uint8]
    """[H, W, 3] uint8 sRGB. Row 0 is at v = 0, as glTF stores it."""
    alpha: NDArray[np.uint8] | None
    """[H, W] uint8 coverage, None when the image is opaque or no material reads it. Stays a plain texture."""
    pixel_hash: str
    """`ntc.codec.textures.hash_pixels` of `pixels`, or of pixels and alpha together when alpha is not None."""
    origin: str
    """Where it came from, for reports: a file name, "image 3 (embedded)"."""
    category: str | None = None
    """From glTF extras ("category" of the image, texture or material), when given."""


@dataclass(frozen=True)
class Material:
    """What the renderer needs of a glTF material."""

    name: str
    texture_id: int
    """Index into `Scene.textures`, -1 when the base colour is the factor alone."""
    factor: tuple[float, float, float, float]
    """Linear RGBA that multiplies the texture. A constant image has been multiplied in."""
    sampler: Sampler = Sampler()
    alpha_mode: AlphaMode = "opaque"
    alpha_cutoff: float = 0.5
    double_sided: bool = False
    unlit: bool = False


@dataclass(frozen=True, eq=False)
class Geometry:
    """All vertices and triangles of the scene in shared arrays."""

    positions: NDArray[np.float32]
    """[V, 3] float32 in the primitive's local space."""
    uvs: NDArray[np.float32]
    """[V, 2] float32: the UV set that the primitive's material reads, texture transform applied."""
    colors: NDArray[np.float32] | None
    """[V, 4] float32 linear RGBA that multiplies the base colour, None when no primitive has vertex colours."""
    indices: NDArray[np.uint32]
    """[3 T] uint32, relative to the primitive's `base_vertex`; always triangles, counter-clockwise in front."""


@dataclass(frozen=True)
class Primitive:
    """A range of the geometry with one material."""

    name: str
    first_index: int
    index_count: int
    base_vertex: int
    vertex_count: int
    material: int


@dataclass(frozen=True, eq=False)
class Instances:
    """Where primitives stand: one row for each (primitive, placement)."""

    primitive: NDArray[np.int32]
    """[N] int32 index into `Scene.primitives`."""
    transform: NDArray[np.float32]
    """[N, 4, 4] float32 local-to-world matrices, to be multiplied with column vectors."""
    node: NDArray[np.int32]
    """[N] int32 index of the glTF node, for names."""


@dataclass(frozen=True)
class Camera:
    """A named viewpoint. glTF cameras look along -Z of their node, +Y up."""

    name: str
    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    fov_degrees: float = 60.0
    """Vertical field of view; unused when `orthographic_height` is set."""
    orthographic_height: float | None = None
    """World height of the view of an orthographic camera, else None."""
    near: float | None = None
    """Near and far distance; None lets the renderer fit them to the scene."""
    far: float | None = None


@dataclass(frozen=True)
class LoadReport:
    """What a file uses and what became of it: shown by `ntc-viewer info` and in the window."""

    used: dict[str, int] = field(default_factory=dict)
    """Counts: nodes, meshes, primitives, instances, triangles, vertices, materials, images, textures, cameras ..."""
    honoured: tuple[str, ...] = ()
    """Features of the file that are drawn as the specification says, e.g. "KHR_texture_transform (12 materials)"."""
    ignored: tuple[str, ...] = ()
    """Features that are in the file and have no effect here, e.g. "normal textures (55)"."""
    missing: tuple[str, ...] = ()
    """Things the file asks for that could not be read, each with its name and what was used instead."""
    notes: tuple[str, ...] = ()
    """E.g. "15 constant images became factors", "BLEND is drawn alpha-hashed"."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A whole scene, ready to be uploaded."""

    name: str
    path: Path | None
    geometry: Geometry
    primitives: tuple[Primitive, ...]
    instances: Instances
    materials: tuple[Material, ...]
    textures: tuple[SceneTexture, ...]
    cameras: tuple[Camera, ...]
    node_names: tuple[str, ...]
    bounds: NDArray[np.float32]
    """[2, 3] float32 world-space minimum and maximum corner."""
    report: LoadReport
