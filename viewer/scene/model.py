"""Data of a loaded scene: plain, immutable numpy arrays. Axes and units are glTF's (Y up, right-handed, metres)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import WrapMode
from ntc.codec.maps import BASE_ALONE, PLANES, MapName, Plane
from viewer.scene.moving import Deformation, MovingVertices
from viewer.scene.pixels import TexturePixels

AlphaMode = Literal["opaque", "mask", "blend"]


@dataclass(frozen=True)
class Sampler:
    """Sampler of a texture (glTF sampler)."""

    wrap: tuple[WrapMode, WrapMode] = ("repeat", "repeat")
    """Along u and v."""
    magnify_linear: bool = True
    minify_linear: bool = True
    mipmap: Literal["none", "nearest", "linear"] = "linear"


@dataclass(frozen=True, eq=False)
class SceneTexture:
    """Distinct image of the scene, or a material set: maps of a material that share size, UVs and sampler. Its index in
    `Scene.textures` is its texture id. Its texels are not all equal: constant maps become factors."""

    name: str
    size: tuple[int, int]
    """(width, height) in texels."""
    has_alpha: bool
    """True if the image is not opaque and a material reads its alpha."""
    pixel_hash: str
    """Identity of the base colour: `ntc.codec.textures.hash_pixels` of `pixels`, together with alpha if there is any. For a set
    without base colour: `set_hash`."""
    origin: str
    """Source of the image, for reports: a file name, "image 3 (embedded)"."""
    source: TexturePixels
    """Reads the pixels when they are needed."""
    category: str | None = None
    """Category from glTF extras ("category" of the image, texture or material), when given."""
    maps: tuple[MapName, ...] = BASE_ALONE
    """Maps of the texture, in the order of `ntc.codec.maps.MAPS`."""
    set_hash: str = ""
    """Identity of a material set: `hash_pixels` of all channels [H, W, C] in the order of `maps`, alpha behind the base colour if
    there is any. For a texture that is no set: `pixel_hash`, or empty."""
    packed_hash: str = ""
    """Identity of the texture of a pack that the scene's file names in its place; "" for none."""

    @property
    def pixels(self) -> NDArray[np.uint8]:
        """Base colour [H, W, 3] uint8 sRGB; for a set without one, a picture of its first map. Row 0 is at v = 0, as in glTF.

        Pixels that are not in memory are read from the file, so store the result for repeated use. This property, `alpha` and
        `further_maps` raise InputError.
        """
        return self.source.picture()

    @property
    def alpha(self) -> NDArray[np.uint8] | None:
        """Alpha [H, W] uint8 of the base colour; None without alpha."""
        return self.source.alpha() if self.has_alpha else None

    @property
    def further_maps(self) -> Mapping[MapName, NDArray[np.uint8]]:
        """Maps besides `base`, each [H, W, channels of the map] uint8."""
        return self.source.further()


@dataclass(frozen=True)
class PlaneTexture:
    """Texture and sampling of the maps of a material's plane (`ntc.codec.maps`)."""

    texture_id: int
    """Index into `Scene.textures`."""
    sampler: Sampler = Sampler()
    maps: tuple[MapName, ...] = ()
    """Maps of the plane that the material reads from the texture; the others have their neutral value."""
    second_uvs: bool = False
    """True if `uv_transform` applies to `Geometry.second_uvs`, False for `Geometry.uvs`."""
    uv_transform: tuple[float, float, float, float, float, float] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    """Transform from the vertex's (u, v) to the map's: rows (a, b, c) and (d, e, f) of u' = a u + b v + c, v' = d u + e v + f."""


@dataclass(frozen=True)
class SurfaceFactors:
    """Factors of a material, without the base colour's: they multiply maps, or replace absent ones (glTF 2.0, Sec. 3.9)."""

    roughness: float = 1.0
    metalness: float = 1.0
    normal_scale: float = 1.0
    occlusion_strength: float = 1.0
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Linear RGB times KHR_materials_emissive_strength; may be above 1."""
    ior: float = 1.5
    """Index of refraction (KHR_materials_ior)."""
    specular: float = 1.0
    """Strength of the reflection of dielectrics, 0 to 1 (KHR_materials_specular)."""
    specular_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Linear RGB of the reflection of dielectrics at normal incidence; may be above 1 (KHR_materials_specular)."""
    clearcoat: float = 0.0
    """Strength of the clear coat, 0 to 1 (KHR_materials_clearcoat). Its textures are not read."""
    clearcoat_roughness: float = 0.0
    transmission: float = 0.0
    """Share of light that passes the surface, 0 to 1 (KHR_materials_transmission). That light is left out: nothing is seen through."""


DEFAULT_FACTORS = SurfaceFactors()


@dataclass(frozen=True)
class Material:
    """Material of the scene, with references to its textures."""

    name: str
    texture_id: int
    """Index into `Scene.textures` of the base colour; -1 for the factor alone."""
    factor: tuple[float, float, float, float]
    """Linear RGBA that multiplies the base colour; includes a constant image."""
    sampler: Sampler = Sampler()
    alpha_mode: AlphaMode = "opaque"
    alpha_cutoff: float = 0.5
    double_sided: bool = False
    unlit: bool = False
    surface: PlaneTexture | None = None
    """Normal, roughness and metalness; None where the factors alone give them."""
    emission: PlaneTexture | None = None
    """Emission and occlusion."""
    factors: SurfaceFactors = DEFAULT_FACTORS
    missing_base: bool = False
    """True where the image of the base colour could not be read: a pattern is drawn instead."""

    def plane(self, plane: Plane) -> PlaneTexture | None:
        """Return the texture and sampling of the maps of `plane`; None without maps."""
        if plane == "base":
            return PlaneTexture(self.texture_id, self.sampler, ("base",)) if self.texture_id >= 0 else None
        return self.surface if plane == "surface" else self.emission

    def plane_texture(self, plane: Plane) -> int:
        """Return the index into `Scene.textures` of a plane's maps, -1 for none."""
        maps = self.plane(plane)
        return maps.texture_id if maps is not None else -1

    @property
    def primary_texture(self) -> int:
        """Texture of the material's first plane with one, -1 for none: texture ids of pixels and divergence show it."""
        return next((texture for plane in PLANES if (texture := self.plane_texture(plane)) >= 0), -1)


@dataclass(frozen=True)
class Light:
    """Light of the scene in world space (KHR_lights_punctual)."""

    kind: Literal["directional", "point", "spot"]
    color: tuple[float, float, float]
    """Linear RGB times intensity: lux for directional lights, candela for the others."""
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    """Unit vector that the light shines along."""
    reach: float = 0.0
    """Distance in metres beyond which the light ends; 0: infinite."""
    inner_cone: float = 0.0
    outer_cone: float = 0.785398
    """Radians from the axis of a spot: full light inside of the inner cone, none outside of the outer one."""


@dataclass(frozen=True)
class AnimationFacts:
    """Name and length of an animation of the file."""

    name: str
    seconds: float
    """Time of the last key frame."""


@dataclass(frozen=True)
class Pose:
    """Animation and time that a scene is posed by."""

    animation: str = ""
    """Name of the animation; "": the first one of the file."""
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class Stand:
    """Positions of all moving parts at one moment."""

    pose: Pose | None
    instances: "Instances"
    deformations: Mapping[int, Deformation]
    """Deformations by node."""
    boxes: Mapping[int, NDArray[np.float64]]
    """[2, 3] around the vertices of primitives that a skin or morph targets move, in local space; by their `base_vertex`."""
    bounds: NDArray[np.float32]
    """[2, 3] of the whole scene, in world space; somewhat wide."""


class Motion(Protocol):
    """Moving parts of a scene."""

    @property
    def moving(self) -> Sequence[MovingVertices]:
        """Vertices that skins and morph targets move."""

    def at(self, pose: Pose | None) -> Stand:
        """Return the positions of all moving parts in a pose; None: without an animation. Raises InputError for an unknown one."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """All vertices and triangles of the scene in shared arrays."""

    positions: NDArray[np.float32]
    """[V, 3] float32 in the primitive's local space."""
    uvs: NDArray[np.float32]
    """[V, 2] float32: the UV set that the primitive's material reads, texture transform applied."""
    colors: NDArray[np.float32] | None
    """[V, 4] float32 linear RGBA that multiplies the base colour, None when no primitive has vertex colours."""
    indices: NDArray[np.uint16] | NDArray[np.uint32]
    """[3 T] uint16 or uint32, relative to the primitive's `base_vertex`; triangles, counter-clockwise on their front."""
    normals: NDArray[np.float32] | None = None
    """[V, 3] float32 unit normals in the primitive's local space, zero where the file gives none: there shaders use the normal of the
    triangle. None when no primitive has any."""
    tangents: NDArray[np.float32] | None = None
    """[V, 4] float32: unit tangent, and the sign of the bitangent; zero where the file gives none: there shaders compute it from
    screen-space derivatives of the UVs. None when no primitive has any."""
    second_uvs: NDArray[np.float32] | None = None
    """[V, 2] float32: second UV set, for materials whose maps read two; None without such materials."""


@dataclass(frozen=True)
class Primitive:
    """Range of the geometry with one material."""

    name: str
    first_index: int
    index_count: int
    base_vertex: int
    vertex_count: int
    material: int


@dataclass(frozen=True, eq=False)
class Instances:
    """Placements of primitives: one row for each (primitive, placement)."""

    primitive: NDArray[np.int32]
    """[N] int32 index into `Scene.primitives`."""
    transform: NDArray[np.float32]
    """[N, 4, 4] float32 local-to-world matrices, to be multiplied with column vectors."""
    node: NDArray[np.int32]
    """[N] int32 index of the glTF node, for names."""


@dataclass(frozen=True)
class Camera:
    """Named viewpoint. glTF cameras look along -Z of their node, +Y up."""

    name: str
    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    fov_degrees: float = 60.0
    """Vertical field of view; unused when `orthographic_height` is set."""
    orthographic_height: float | None = None
    """Height in metres of the view of an orthographic camera; None for perspective."""
    near: float | None = None
    """Near and far distance; None lets the renderer fit them to the scene."""
    far: float | None = None


@dataclass(frozen=True)
class LoadReport:
    """Report of the content of a file and of how it was read, for `ntc-viewer info` and the window."""

    used: dict[str, int] = field(default_factory=dict)
    """Counts: nodes, meshes, primitives, instances, triangles, vertices, materials, images, textures, cameras ..."""
    honoured: tuple[str, ...] = ()
    """Features of the file that are drawn as the specification says, e.g. "KHR_texture_transform (12 materials)"."""
    ignored: tuple[str, ...] = ()
    """Features that are in the file and have no effect here, e.g. "normal textures (55)"."""
    missing: tuple[str, ...] = ()
    """Files and data that could not be read, each with what is used instead."""
    repaired: tuple[str, ...] = ()
    """Broken values of the file, and what is used instead, e.g. normals without a direction."""
    notes: tuple[str, ...] = ()
    """Other remarks, e.g. "15 constant images became factors", "BLEND is drawn alpha-hashed"."""


GENERIC_NAMES = frozenset(("scene", "model", "untitled", "index"))
"""File names that do not describe the scene."""


def title_of(path: Path) -> str:
    """Return the name of a scene's file without its suffix, or of its folder for a file name such as scene.gltf."""
    return path.absolute().parent.name if path.stem in GENERIC_NAMES and path.absolute().parent.name else path.stem


def shown_file(path: Path) -> str:
    """Return the name of a file for lists; with its folder for a file name such as scene.gltf."""
    return f"{path.parent.name}/{path.name}" if path.stem in GENERIC_NAMES and path.parent.name else path.name


@dataclass(frozen=True, eq=False)
class Scene:
    """Whole scene, ready to be uploaded to the GPU."""

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
    lights: tuple[Light, ...] = ()
    variants: tuple[str, ...] = ()
    """Names of the file's material variants."""
    variant: str = ""
    """Name of the variant that is drawn; "": the materials that primitives name themselves."""
    animations: tuple[AnimationFacts, ...] = ()
    pose: Pose | None = None
    """Animation and time at which the scene was read; None: without an animation."""
    motion: Motion | None = None
    """Parts that animations move; None without any."""
    file_stamp: tuple[int, int] | None = None
    """(bytes, nanoseconds of the last change) of the file when it was read; None for a scene without a file."""
    packs: tuple[Path, ...] = ()
    """Packs that the scene's file names."""

    @property
    def title(self) -> str:
        """Title of the scene: its name, or that of its folder for a file name such as scene.gltf."""
        return title_of(self.path) if self.path is not None and self.name in GENERIC_NAMES else self.name
