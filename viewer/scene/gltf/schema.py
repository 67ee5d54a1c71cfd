"""The objects of a glTF file as they are read: types, bounds and defaults (glTF 2.0, Sec. 5, and the schemas of the extensions).

Unknown properties are allowed everywhere. Properties of type `Any` are checked where they are used, because their faults are only
reported, or have no effect. Indices are checked where they are used, against the arrays that they point into.
"""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, Literal

from msgspec import UNSET, Meta, Struct, UnsetType

Number = Annotated[float, Meta(gt=-1e38, lt=1e38)]
"""Number that is finite in single precision."""
Whole = Annotated[int, Meta(ge=0, le=2**53)] | Annotated[float, Meta(ge=0, le=2**53, multiple_of=1)]
"""Whole number, which some exporters write as 4.0."""
UvSet = Annotated[int, Meta(ge=0, le=255)] | Annotated[float, Meta(ge=0, le=255, multiple_of=1)]
Stride = Annotated[int, Meta(ge=0, le=252)] | Annotated[float, Meta(ge=0, le=252, multiple_of=1)]
MeshoptStride = Annotated[int, Meta(ge=0, le=256)] | Annotated[float, Meta(ge=0, le=256, multiple_of=1)]
PrimitiveMode = Annotated[int, Meta(ge=0, le=6)] | Annotated[float, Meta(ge=0, le=6, multiple_of=1)]
Layer = Annotated[int, Meta(ge=0, le=65535)] | Annotated[float, Meta(ge=0, le=65535, multiple_of=1)]
Index = Annotated[int, Meta(ge=0)]
ABSENT = -1
"""Default of an optional index."""
Pair = tuple[Number, Number]
Triple = tuple[Number, Number, Number]
Quadruple = tuple[Number, Number, Number, Number]
Attributes = dict[str, Any]
"""Accessors by attribute name. Accessors that are not read may be broken."""


class Extensible(Struct, frozen=True, rename="camel"):
    """Object that may have extensions, by name."""

    extensions: Mapping[str, Any] = MappingProxyType({})


class Asset(Struct, frozen=True, rename="camel"):
    """Version of glTF that the file was written in."""

    version: str = ""
    min_version: str = "2.0"


class Document(Extensible, frozen=True):
    """Extensions of the whole file."""

    extensions_used: tuple[str, ...] = ()
    extensions_required: tuple[str, ...] = ()


class Scene(Struct, frozen=True):
    """A scene: its root nodes."""

    nodes: tuple[Index, ...] = ()


class Node(Extensible, frozen=True, gc=False):
    """Node of the graph. A file may have a million; they hold no cycles, so the garbage collector skips them."""

    children: tuple[Index, ...] = ()
    matrix: Annotated[tuple[Number, ...], Meta(min_length=16, max_length=16)] | UnsetType = UNSET
    """Columns one after another."""
    translation: Triple = (0.0, 0.0, 0.0)
    rotation: Quadruple = (0.0, 0.0, 0.0, 1.0)
    """Quaternion xyzw."""
    scale: Triple = (1.0, 1.0, 1.0)
    mesh: Index = ABSENT
    camera: Index = ABSENT
    skin: Index = ABSENT
    weights: tuple[Number, ...] | UnsetType = UNSET


class Instancing(Struct, frozen=True):
    """Instances of a node's mesh (EXT_mesh_gpu_instancing)."""

    attributes: Attributes = {}


class Visibility(Struct, frozen=True):
    """Visibility of a node (KHR_node_visibility)."""

    visible: Any = True


class Skin(Struct, frozen=True, rename="camel"):
    """Joints of a skin."""

    joints: tuple[Index, ...] = ()
    inverse_bind_matrices: Index = ABSENT


class Primitive(Extensible, frozen=True):
    """A part of a mesh with one material."""

    mode: PrimitiveMode = 4
    attributes: Attributes = {}
    indices: Index = ABSENT
    material: Index = ABSENT
    targets: tuple[Attributes, ...] = ()


class Mesh(Extensible, frozen=True):
    """Mesh: primitives, and default weights of morph targets."""

    primitives: tuple[Primitive, ...] = ()
    weights: tuple[Number, ...] = ()


class Draco(Struct, frozen=True, rename="camel"):
    """Draco compression of a primitive (KHR_draco_mesh_compression): unique ids in the compressed data, by attribute name."""

    buffer_view: Index
    attributes: dict[str, int] = {}


class Variants(Struct, frozen=True):
    """Names of the file's material variants (KHR_materials_variants)."""

    variants: tuple[dict[str, Any], ...] = ()


class VariantMapping(Struct, frozen=True):
    """A material and the variants that show it."""

    material: Index
    variants: tuple[Index, ...] = ()


class VariantMappings(Struct, frozen=True):
    """Materials of a primitive by variant (KHR_materials_variants)."""

    mappings: tuple[VariantMapping, ...] = ()


class Buffer(Struct, frozen=True, rename="camel"):
    """Buffer; without a `uri`, the binary chunk of a GLB."""

    byte_length: Whole
    uri: str | UnsetType = UNSET


class BufferView(Extensible, frozen=True, kw_only=True):
    """A range of a buffer. A compressed view names its buffer in an extension."""

    byte_length: Whole
    byte_offset: Whole = 0
    byte_stride: Stride = 0
    buffer: Index = ABSENT


MeshoptMode = Literal["ATTRIBUTES", "TRIANGLES", "INDICES"]
MeshoptFilter = Literal["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"]


class Meshopt(Struct, frozen=True, rename="camel"):
    """Compression of a buffer view (EXT_meshopt_compression and KHR_meshopt_compression)."""

    buffer: Index
    byte_length: Whole
    """Bytes, compressed."""
    byte_stride: MeshoptStride
    """Bytes of an element."""
    count: Whole
    mode: MeshoptMode
    byte_offset: Whole = 0
    filter: MeshoptFilter = "NONE"


class SparseIndices(Struct, frozen=True, rename="camel"):
    """Indices of the elements that a sparse accessor replaces."""

    buffer_view: Index
    component_type: Whole
    byte_offset: Whole = 0


class SparseValues(Struct, frozen=True, rename="camel"):
    """Values that a sparse accessor replaces elements with."""

    buffer_view: Index
    byte_offset: Whole = 0


class Sparse(Struct, frozen=True):
    """Replacements of some elements of an accessor."""

    count: Whole
    indices: SparseIndices
    values: SparseValues


class Accessor(Struct, frozen=True, rename="camel"):
    """Typed elements of a buffer view; without one, all are zero."""

    type: str
    component_type: Whole
    count: Whole
    buffer_view: Index = ABSENT
    byte_offset: Whole = 0
    normalized: Any = False
    sparse: Sparse | UnsetType = UNSET


class AnimationTarget(Struct, frozen=True):
    """The property that a channel changes."""

    node: Any = UNSET
    path: Any = None


class AnimationChannel(Struct, frozen=True):
    """Channel of an animation: a sampler and its target."""

    target: AnimationTarget = AnimationTarget()
    sampler: Any = None


Interpolation = Literal["LINEAR", "STEP", "CUBICSPLINE"]


class AnimationSampler(Struct, frozen=True):
    """Key frames of a channel: accessors of times and values, and the interpolation."""

    input: Index
    output: Index
    interpolation: Interpolation = "LINEAR"


class Animation(Struct, frozen=True):
    """Animation. Samplers that no channel uses may be broken."""

    channels: tuple[AnimationChannel, ...] = ()
    samplers: tuple[Any, ...] = ()


class Perspective(Struct, frozen=True, rename="camel"):
    """Lens of a perspective camera."""

    yfov: Annotated[float, Meta(gt=0.0, lt=math.pi)] = math.radians(60.0)
    """Vertical field of view in radians."""
    znear: Number = 0.0
    zfar: Number = 0.0
    aspect_ratio: Any = UNSET


class Orthographic(Struct, frozen=True):
    """Lens of an orthographic camera."""

    ymag: Number = 1.0
    """Half of the height of the view."""
    znear: Number = 0.0
    zfar: Number = 0.0


class Camera(Struct, frozen=True):
    """Camera: its type, and the lens of that type."""

    type: Literal["perspective", "orthographic"]
    perspective: Perspective = Perspective()
    orthographic: Orthographic = Orthographic()


class Spot(Struct, frozen=True, rename="camel"):
    """Cone of a spot light: angles from its axis in radians."""

    inner_cone_angle: Number = 0.0
    outer_cone_angle: Number = math.pi / 4


class Light(Struct, frozen=True):
    """A light of KHR_lights_punctual."""

    type: Literal["directional", "point", "spot"]
    color: Triple = (1.0, 1.0, 1.0)
    intensity: Number = 1.0
    range: Number = 0.0
    """Metres; 0: infinite."""
    spot: Spot = Spot()


class Lights(Struct, frozen=True):
    """Lights of the file (KHR_lights_punctual). Lights that no node holds may be broken."""

    lights: tuple[Any, ...] = ()


class LightOfNode(Struct, frozen=True):
    """Light at a node (KHR_lights_punctual)."""

    light: Index


class Texture(Extensible, frozen=True):
    """An image with a sampler."""

    source: Index = ABSENT
    sampler: Index = ABSENT


class Sampler(Struct, frozen=True, rename="camel"):
    """A sampler. Unknown values are reported, and the defaults used."""

    wrap_s: Any = 10497
    wrap_t: Any = 10497
    mag_filter: Any = 9729
    min_filter: Any = 9987


class OtherImage(Struct, frozen=True):
    """Extension of a texture that names another image."""

    source: Index = ABSENT


class Image(Struct, frozen=True, rename="camel"):
    """Location of an image: a URI or a buffer view."""

    uri: str | UnsetType = UNSET
    buffer_view: Index = ABSENT


class Swizzle(Struct, frozen=True):
    """Alternative images of a texture (NV_texture_swizzle). Options of other formats may have other properties."""

    options: tuple[dict[str, Any], ...] = ()


Channel = Annotated[int, Meta(ge=-1, le=255)]


class SwizzleOption(Struct, frozen=True, rename="camel"):
    """An option of NV_texture_swizzle that names a texture of a pack."""

    source: Index
    array_layer: Layer = 0
    channels: tuple[Channel, Channel, Channel, Channel] = (0, 1, 2, 3)
    extras: Any = None


class TextureTransform(Struct, frozen=True, rename="camel"):
    """Transform of UVs (KHR_texture_transform)."""

    offset: Pair = (0.0, 0.0)
    rotation: Number = 0.0
    scale: Pair = (1.0, 1.0)
    tex_coord: UvSet | UnsetType = UNSET


class TextureInfo(Extensible, frozen=True, kw_only=True):
    """Texture of a map, and the UV set that it is sampled with."""

    index: Index
    tex_coord: UvSet = 0


class NormalTexture(TextureInfo, frozen=True):
    """Texture of normals."""

    scale: Number = 1.0


class OcclusionTexture(TextureInfo, frozen=True):
    """Texture of occlusion."""

    strength: Number = 1.0


class BaseColor(Struct, frozen=True, rename="camel"):
    """Colours that every material has, unlit ones too."""

    base_color_factor: Quadruple = (1.0, 1.0, 1.0, 1.0)
    base_color_texture: TextureInfo | UnsetType = UNSET


class MetallicRoughness(BaseColor, frozen=True):
    """Colours of a material with metalness and roughness."""

    metallic_factor: Number = 1.0
    roughness_factor: Number = 1.0
    metallic_roughness_texture: TextureInfo | UnsetType = UNSET


class Material(Extensible, frozen=True):
    """Properties that are read of every material."""

    pbr_metallic_roughness: BaseColor = BaseColor()
    alpha_mode: Literal["OPAQUE", "MASK", "BLEND"] = "OPAQUE"
    alpha_cutoff: Number = 0.5
    double_sided: Any = False


class LitMaterial(Material, frozen=True):
    """Material that is lit."""

    pbr_metallic_roughness: MetallicRoughness = MetallicRoughness()
    normal_texture: NormalTexture | UnsetType = UNSET
    occlusion_texture: OcclusionTexture | UnsetType = UNSET
    emissive_texture: TextureInfo | UnsetType = UNSET
    emissive_factor: Triple = (0.0, 0.0, 0.0)


class SpecularGlossiness(Struct, frozen=True, rename="camel"):
    """Colours of a specular-glossiness material (KHR_materials_pbrSpecularGlossiness)."""

    diffuse_factor: Quadruple = (1.0, 1.0, 1.0, 1.0)
    diffuse_texture: TextureInfo | UnsetType = UNSET
    specular_factor: Triple = (1.0, 1.0, 1.0)
    glossiness_factor: Number = 1.0
    specular_glossiness_texture: Any = UNSET


class Unlit(Struct, frozen=True):
    """Mark of an unlit material (KHR_materials_unlit)."""


class EmissiveStrength(Struct, frozen=True, rename="camel"):
    """Multiplier of the emissive factor (KHR_materials_emissive_strength)."""

    emissive_strength: Number = 1.0


class Ior(Struct, frozen=True):
    """Index of refraction (KHR_materials_ior)."""

    ior: Number = 1.5


class Specular(Struct, frozen=True, rename="camel"):
    """Strength and colour of specular reflection (KHR_materials_specular). Its textures are not read."""

    specular_factor: Number = 1.0
    specular_color_factor: Triple = (1.0, 1.0, 1.0)


class Clearcoat(Struct, frozen=True, rename="camel"):
    """Clear coat (KHR_materials_clearcoat). Its textures are not read."""

    clearcoat_factor: Number = 0.0
    clearcoat_roughness_factor: Number = 0.0


class Transmission(Struct, frozen=True, rename="camel"):
    """Transmission of light (KHR_materials_transmission). Its texture is not read."""

    transmission_factor: Number = 0.0
