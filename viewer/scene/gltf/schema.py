"""The objects of a glTF file as they are read: types, bounds and defaults (glTF 2.0, Sec. 5, and the schemas of the extensions).

Unknown properties are allowed everywhere. Properties of type `Any` are checked where they are used, because what is wrong with them
is only reported, or has no effect. Indices are checked against the arrays that they point into where they are used.
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
"""Default of an index that an object need not have."""
Pair = tuple[Number, Number]
Triple = tuple[Number, Number, Number]
Quadruple = tuple[Number, Number, Number, Number]
Attributes = dict[str, Any]
"""Accessors by the name of the attribute. Those that are not read may be broken."""


class Extensible(Struct, frozen=True, rename="camel"):
    """Object that may have extensions, by their names."""

    extensions: Mapping[str, Any] = MappingProxyType({})


class Asset(Struct, frozen=True, rename="camel"):
    """Version of glTF that the file was written in."""

    version: str = ""
    min_version: str = "2.0"


class Document(Extensible, frozen=True):
    """The extensions of the whole file."""

    extensions_used: tuple[str, ...] = ()
    extensions_required: tuple[str, ...] = ()


class Scene(Struct, frozen=True):
    """A scene: its root nodes."""

    nodes: tuple[Index, ...] = ()


class Node(Extensible, frozen=True, gc=False):
    """A node of the graph. There may be a million: without cycles they need no garbage collection."""

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
    """EXT_mesh_gpu_instancing."""

    attributes: Attributes = {}


class Visibility(Struct, frozen=True):
    """KHR_node_visibility."""

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
    """A mesh."""

    primitives: tuple[Primitive, ...] = ()
    weights: tuple[Number, ...] = ()


class Draco(Struct, frozen=True, rename="camel"):
    """KHR_draco_mesh_compression: attributes by name, each its number in the compressed data."""

    buffer_view: Index
    attributes: dict[str, int] = {}


class Variants(Struct, frozen=True):
    """KHR_materials_variants of the file: objects with names."""

    variants: tuple[dict[str, Any], ...] = ()


class VariantMapping(Struct, frozen=True):
    """A material and the variants that show it."""

    material: Index
    variants: tuple[Index, ...] = ()


class VariantMappings(Struct, frozen=True):
    """KHR_materials_variants of a primitive."""

    mappings: tuple[VariantMapping, ...] = ()


class Buffer(Struct, frozen=True, rename="camel"):
    """A buffer; without `uri` the binary chunk of a GLB."""

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
    """EXT_meshopt_compression and KHR_meshopt_compression of a buffer view."""

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
    """Places of the elements that a sparse accessor replaces."""

    buffer_view: Index
    component_type: Whole
    byte_offset: Whole = 0


class SparseValues(Struct, frozen=True, rename="camel"):
    """Elements of a sparse accessor."""

    buffer_view: Index
    byte_offset: Whole = 0


class Sparse(Struct, frozen=True):
    """Elements of an accessor that are replaced."""

    count: Whole
    indices: SparseIndices
    values: SparseValues


class Accessor(Struct, frozen=True, rename="camel"):
    """Elements of a buffer view; without one they are zero."""

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
    """A channel of an animation."""

    target: AnimationTarget = AnimationTarget()
    sampler: Any = None


Interpolation = Literal["LINEAR", "STEP", "CUBICSPLINE"]


class AnimationSampler(Struct, frozen=True):
    """Key frames."""

    input: Index
    output: Index
    interpolation: Interpolation = "LINEAR"


class Animation(Struct, frozen=True):
    """An animation. Samplers that no channel uses may be broken."""

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
    """A camera."""

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
    """Metres; 0: without an end."""
    spot: Spot = Spot()


class Lights(Struct, frozen=True):
    """KHR_lights_punctual of the file. Lights that stand nowhere may be broken."""

    lights: tuple[Any, ...] = ()


class LightOfNode(Struct, frozen=True):
    """KHR_lights_punctual of a node."""

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
    """The place of an image."""

    uri: str | UnsetType = UNSET
    buffer_view: Index = ABSENT


class Swizzle(Struct, frozen=True):
    """NV_texture_swizzle. Options of other formats have other properties than ours."""

    options: tuple[dict[str, Any], ...] = ()


Channel = Annotated[int, Meta(ge=-1, le=255)]


class SwizzleOption(Struct, frozen=True, rename="camel"):
    """An option of NV_texture_swizzle that names a texture of a pack."""

    source: Index
    array_layer: Layer = 0
    channels: tuple[Channel, Channel, Channel, Channel] = (0, 1, 2, 3)
    extras: Any = None


class TextureTransform(Struct, frozen=True, rename="camel"):
    """KHR_texture_transform."""

    offset: Pair = (0.0, 0.0)
    rotation: Number = 0.0
    scale: Pair = (1.0, 1.0)
    tex_coord: UvSet | UnsetType = UNSET


class TextureInfo(Extensible, frozen=True, kw_only=True):
    """The texture of a map, and the UVs that it is sampled by."""

    index: Index
    tex_coord: UvSet = 0


class NormalTexture(TextureInfo, frozen=True):
    """The texture of normals."""

    scale: Number = 1.0


class OcclusionTexture(TextureInfo, frozen=True):
    """The texture of occlusion."""

    strength: Number = 1.0


class BaseColor(Struct, frozen=True, rename="camel"):
    """What an unlit material reads of its colours."""

    base_color_factor: Quadruple = (1.0, 1.0, 1.0, 1.0)
    base_color_texture: TextureInfo | UnsetType = UNSET


class MetallicRoughness(BaseColor, frozen=True):
    """Colours of a material with metalness and roughness."""

    metallic_factor: Number = 1.0
    roughness_factor: Number = 1.0
    metallic_roughness_texture: TextureInfo | UnsetType = UNSET


class Material(Extensible, frozen=True):
    """What is read of every material."""

    pbr_metallic_roughness: BaseColor = BaseColor()
    alpha_mode: Literal["OPAQUE", "MASK", "BLEND"] = "OPAQUE"
    alpha_cutoff: Number = 0.5
    double_sided: Any = False


class LitMaterial(Material, frozen=True):
    """A material that light has an effect on."""

    pbr_metallic_roughness: MetallicRoughness = MetallicRoughness()
    normal_texture: NormalTexture | UnsetType = UNSET
    occlusion_texture: OcclusionTexture | UnsetType = UNSET
    emissive_texture: TextureInfo | UnsetType = UNSET
    emissive_factor: Triple = (0.0, 0.0, 0.0)


class SpecularGlossiness(Struct, frozen=True, rename="camel"):
    """KHR_materials_pbrSpecularGlossiness."""

    diffuse_factor: Quadruple = (1.0, 1.0, 1.0, 1.0)
    diffuse_texture: TextureInfo | UnsetType = UNSET
    specular_factor: Triple = (1.0, 1.0, 1.0)
    glossiness_factor: Number = 1.0
    specular_glossiness_texture: Any = UNSET


class Unlit(Struct, frozen=True):
    """KHR_materials_unlit."""


class EmissiveStrength(Struct, frozen=True, rename="camel"):
    """KHR_materials_emissive_strength."""

    emissive_strength: Number = 1.0


class Ior(Struct, frozen=True):
    """KHR_materials_ior."""

    ior: Number = 1.5


class Specular(Struct, frozen=True, rename="camel"):
    """KHR_materials_specular; its textures are not read."""

    specular_factor: Number = 1.0
    specular_color_factor: Triple = (1.0, 1.0, 1.0)


class Clearcoat(Struct, frozen=True, rename="camel"):
    """KHR_materials_clearcoat; its textures are not read."""

    clearcoat_factor: Number = 0.0
    clearcoat_roughness_factor: Number = 0.0


class Transmission(Struct, frozen=True, rename="camel"):
    """KHR_materials_transmission; its texture is not read."""

    transmission_factor: Number = 0.0
