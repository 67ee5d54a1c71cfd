"""A scene's geometry, instances and materials on the GPU."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.codec.gpu import WRAP_CODES
from ntc.codec.maps import MAP_CHANNELS, PLANE_COMPONENTS, PLANES, MapName, Plane
from ntc.errors import InputError
from viewer.gl.allocation import ALL_MIPS, replace_content
from viewer.gl.context import GraphicsContext
from viewer.gl.functions import GL_TRIANGLES, GL_UNSIGNED_INT, GL_UNSIGNED_SHORT
from viewer.render.resources.coverage import PackedCoverage
from viewer.render.resources.culling import Bucket, DrawList, GpuDrawList
from viewer.render.resources.layout import (
    ALPHA_CODES,
    LARGEST_ID,
    MATERIAL_RECORD,
    MATERIAL_SHIFT,
    StorageBinding,
    TextureUnit,
    sampler_flags,
)
from viewer.render.resources.samplers import SamplerCache
from viewer.scene.model import Camera, Material, Sampler, Scene

SMALLEST_MIP = 8
"""Largest side in texels of a mip that may be the last one of a pyramid."""
COMPONENTS_OF_MAP: dict[MapName, int] = {**MAP_CHANNELS, "base": 4}
"""Number of components of a plane that each map takes."""


def component_bits(plane: Plane, maps: tuple[MapName, ...]) -> int:
    """Return the set of the plane's components that `maps` take, as a bit for each."""
    places = PLANE_COMPONENTS[plane]
    taken = [range(places[name], places[name] + COMPONENTS_OF_MAP[name]) for name in maps if name in places]
    return sum(1 << component for part in taken for component in part)


def dielectric_reflectance(material: Material) -> tuple[float, float, float, float]:
    """Return the reflectance of a dielectric: linear RGB at normal incidence, then the one at grazing incidence.

    See KHR_materials_ior and KHR_materials_specular.
    """
    factors = material.factors
    plain = ((factors.ior - 1.0) / (factors.ior + 1.0)) ** 2 if factors.ior > 0.0 else 1.0
    red, green, blue = (min(plain * color, 1.0) * factors.specular for color in factors.specular_color)
    return red, green, blue, factors.specular


def alike_planes(material: Material) -> int:
    """Return two bits for each plane: the number of the first plane that reads the same texture at the same texels."""
    readings = [None if reading is None else replace(reading, maps=()) for reading in map(material.plane, PLANES)]
    return sum(readings.index(reading) << 2 * number for number, reading in enumerate(readings))


def material_records(scene: Scene) -> np.ndarray:
    """Return [materials] MATERIAL_RECORD; the reference pass fills in `image_array` and `image_layer`."""
    records = np.zeros(max(1, len(scene.materials)), MATERIAL_RECORD)
    records["planes"]["uv_u"][..., 0] = records["planes"]["uv_v"][..., 1] = 1.0
    records["planes"]["texture_id"] = records["planes"]["image_array"] = -1
    for record, material in zip(records, scene.materials, strict=False):
        factors = material.factors
        record["factor"] = material.factor
        record["emissive"] = (*factors.emissive, factors.occlusion_strength)
        record["surface"] = (factors.roughness, factors.metalness, factors.normal_scale, factors.transmission)
        record["specular"] = dielectric_reflectance(material)
        record["alpha_cutoff"] = material.alpha_cutoff
        record["alpha_mode"] = ALPHA_CODES[material.alpha_mode]
        record["unlit"], record["missing_base"] = material.unlit, material.missing_base
        record["clearcoat"], record["clearcoat_roughness"] = factors.clearcoat, factors.clearcoat_roughness
        record["alike"] = alike_planes(material)
        for plane_record, plane in zip(record["planes"], PLANES, strict=True):
            # Coverage is read like the base colour, even without a base colour.
            plane_record["wrap_u"], plane_record["wrap_v"] = (WRAP_CODES[mode] for mode in material.sampler.wrap)
            plane_texture = material.plane(plane)
            if plane_texture is None:
                continue
            plane_record["texture_id"] = plane_texture.texture_id
            plane_record["wrap_u"], plane_record["wrap_v"] = (WRAP_CODES[mode] for mode in plane_texture.sampler.wrap)
            plane_record["sampler_flags"] = sampler_flags(plane_texture.sampler)
            plane_record["components"] = component_bits(plane, plane_texture.maps)
            plane_record["second_uvs"] = plane_texture.second_uvs
            plane_record["uv_u"][:3], plane_record["uv_v"][:3] = (
                plane_texture.uv_transform[:3],
                plane_texture.uv_transform[3:],
            )
    return records


INSTANCE_FORMAT = "4f 4f 4f 1u 1f /i"
FIRST_INSTANCE_LOCATION = 3
"""Location of the first attribute of an instance in shaders/common/scene.vert."""
INSTANCE_NAMES = ("transform_x", "transform_y", "transform_z", "instance_ids", "instance_aspect")
VERTICES_AT_ONCE = 1 << 20
"""Number of vertices that are interleaved and uploaded at once."""

AnyDrawList = DrawList | GpuDrawList


class SceneBuffers:
    """Buffers of a scene: vertices, indices, instances, materials, and the draw commands of the current draw list."""

    def __init__(self, context: GraphicsContext, scene: Scene) -> None:
        """Upload the scene except optional vertex data. Raises InputError for too many textures or materials, GpuMemoryError."""
        if max(len(scene.textures), len(scene.materials)) > LARGEST_ID:
            raise InputError(f"{scene.name}: has more than {LARGEST_ID} textures or materials; split the scene")
        self._context, self._gl, self._memory = context, context.gl, context.memory
        self._scene = scene
        geometry = scene.geometry
        self._index_bytes = geometry.indices.itemsize
        self._rows = self._instance_rows()
        self.materials = material_records(scene)
        """[materials] MATERIAL_RECORD; `upload_materials` uploads them again after a change."""
        with self._memory.transaction():
            self._vertices = self._interleaved("vertices", geometry.positions, geometry.uvs)
            self._colors = None if geometry.colors is None else self._buffer("colours", geometry.colors)
            self._indices = self._buffer("indices", geometry.indices)
            self._instances = self._buffer("instances", self._rows)
            self._materials = self._buffer("materials", self.materials)
        self._optional: dict[str, moderngl.Buffer] = {}
        """Buffers of vertex data that only some views read, by the attribute's name; uploaded when one does."""
        self.coverage = 0
        """Version of the textures' coverage; it changes whenever masked or blended surfaces may look different."""
        self._alpha: dict[int, moderngl.Texture] = {}
        self._packed: dict[int, PackedCoverage] = {}
        self._samplers = SamplerCache(context)
        self._commands: moderngl.Buffer | None = None
        self._draw_list: AnyDrawList | None = None
        self._ranges: tuple[tuple[Bucket, int, int], ...] = ()
        self._arrays: dict[moderngl.Program, moderngl.VertexArray] = {}

    @property
    def has_colors(self) -> bool:
        """True where the scene has vertex colours."""
        return self._colors is not None

    @property
    def has_second_uvs(self) -> bool:
        """True if some maps use a second UV set."""
        return self._scene.geometry.second_uvs is not None

    def _optional_content(self, program: moderngl.Program) -> list[tuple[object, ...]]:
        """Return the normals, tangents and second UVs that `program` reads. Absent attributes have OpenGL's default, 0."""
        geometry, content = self._scene.geometry, list[tuple[object, ...]]()
        for name, array in (
            ("normal", geometry.normals),
            ("tangent", geometry.tangents),
            ("second_texture_coordinate", geometry.second_uvs),
        ):
            if array is None or program.get(name, None) is None:
                continue
            content.append((self._optional_buffer(name, array), f"{array.shape[1]}f", name))
        return content

    def _optional_buffer(self, name: str, array: np.ndarray) -> moderngl.Buffer:
        if name not in self._optional:
            self._optional[name] = self._buffer(name.replace("_", " ") + "s", array)
        return self._optional[name]

    @property
    def vertex_floats(self) -> int:
        """Number of floats of a vertex in the first of `moving_buffers`: its position, then its UV."""
        return sum(array.shape[1] for array in (self._scene.geometry.positions, self._scene.geometry.uvs))

    def moving_buffers(self) -> tuple[moderngl.Buffer, moderngl.Buffer, moderngl.Buffer]:
        """Return the buffers of positions, normals ([V, 3]) and tangents ([V, 4]); that of positions for absent ones.

        After this call, their content may differ from the scene's geometry. Raises GpuMemoryError.
        """
        normals, tangents = self._scene.geometry.normals, self._scene.geometry.tangents
        return (
            self._vertices,
            self._vertices if normals is None else self._optional_buffer("normal", normals),
            self._vertices if tangents is None else self._optional_buffer("tangent", tangents),
        )

    def write_vertices(
        self, base: int, positions: np.ndarray, normals: np.ndarray | None, tangents: np.ndarray | None
    ) -> None:
        """Replace positions [V, 3], and normals and tangents unless None, of the vertices from `base` on. Raises GpuMemoryError."""
        vertices, of_normals, of_tangents = self.moving_buffers()
        uvs = self._scene.geometry.uvs[base : base + len(positions)]
        rows = np.concatenate([positions, uvs], axis=1).astype("<f4")
        for buffer, content in ((vertices, rows), (of_normals, normals), (of_tangents, tangents)):
            if content is not None and len(content):
                self._memory.write(buffer, content.tobytes(), base * content.shape[1] * 4)

    def place_instances(self, transforms: np.ndarray) -> None:
        """Place the instances by [N, 4, 4] local-to-world matrices. Raises GpuMemoryError."""
        self._rows["transform"] = transforms[:, :3, :]
        self._memory.write(self._instances, self._rows.tobytes())

    def _buffer(self, kind: str, array: np.ndarray) -> moderngl.Buffer:
        # OpenGL has no empty buffers.
        content = np.ascontiguousarray(array).reshape(-1).view(np.uint8) if array.size else bytes(64)
        return self._memory.buffer(f"{kind} of {self._scene.name}", content)

    def _interleaved(self, kind: str, *arrays: np.ndarray) -> moderngl.Buffer:
        """Return a buffer of rows of `arrays` [V, ...] float32 one after another, written in pieces to save memory."""
        count, stride = len(arrays[0]), sum(array.shape[1] for array in arrays) * 4
        buffer = self._memory.buffer(f"{kind} of {self._scene.name}", reserve=max(64, count * stride))
        for start in range(0, count, VERTICES_AT_ONCE):
            piece = np.concatenate([array[start : start + VERTICES_AT_ONCE] for array in arrays], axis=1)
            buffer.write(piece, offset=start * stride)
        return buffer

    def _instance_rows(self) -> np.ndarray:
        instances, primitives = self._scene.instances, self._scene.primitives
        rows = np.zeros(
            len(instances.primitive), np.dtype([("transform", "<f4", (3, 4)), ("ids", "<u4"), ("aspect", "<f4")])
        )
        rows["transform"] = instances.transform[:, :3, :]
        material = np.array([primitive.material for primitive in primitives], np.int64)[instances.primitive]
        texture = np.array([entry.primary_texture for entry in self._scene.materials], np.int64)[material]
        rows["ids"] = (texture + 1) | ((material + 1) << MATERIAL_SHIFT)
        sizes = [image.size for image in self._scene.textures]
        aspects = np.array([height / width for width, height in sizes] + [1.0])
        rows["aspect"] = aspects[texture]
        return rows

    def _vertex_array(self, program: moderngl.Program) -> moderngl.VertexArray:
        if program not in self._arrays:
            content: list[tuple[object, ...]] = [(self._vertices, "3f 2f", "position", "texture_coordinate")]
            if self._colors is not None:
                content.append((self._colors, "4f", "vertex_color"))
            content += self._optional_content(program)
            if self._context.features.compute:
                content.append((self._instances, INSTANCE_FORMAT, *INSTANCE_NAMES))
            # Attributes that a program does not read are skipped.
            self._arrays[program] = self._gl.vertex_array(
                program, content, self._indices, index_element_size=self._index_bytes, skip_errors=True
            )
        return self._arrays[program]

    def take_coverage(self, packed: Mapping[int, PackedCoverage]) -> None:
        """Use the packed coverage of these textures, by id, and the images' coverage of all others."""
        changed = {number for number in {*self._packed, *packed} if self._packed.get(number) != packed.get(number)}
        if changed:
            self.coverage += 1
            self._packed = dict(packed)
        for number in changed.intersection(self._alpha):
            self._alpha.pop(number).release()

    def _alpha_texture(self, texture_id: int) -> moderngl.Texture:
        if texture_id not in self._alpha:
            self._alpha[texture_id] = self._upload_coverage(texture_id)
        return self._alpha[texture_id]

    def _upload_coverage(self, texture_id: int) -> moderngl.Texture:
        what = "coverage" if texture_id < 0 else f"coverage of texture {self._scene.textures[texture_id].name}"
        mips = self._packed[texture_id].mips() if texture_id in self._packed else ()
        alpha = self._scene.textures[texture_id].alpha if texture_id >= 0 and not mips else None
        first = mips[0] if mips else np.full((1, 1), 255, np.uint8) if alpha is None else np.ascontiguousarray(alpha)
        texture = self._memory.texture(what, (first.shape[1], first.shape[0]), 1, first.tobytes())
        if not mips:
            self._memory.build_mipmaps(what, texture)
            return texture
        # A pack's mips preserve the coverage of thin parts, which averaged mips lose. So a full pyramid ends where the pack's ends.
        is_whole = max(mips[-1].shape) <= SMALLEST_MIP
        self._memory.build_mipmaps(what, texture, len(mips) - 1 if is_whole else ALL_MIPS)
        for level, mip in enumerate(mips):
            texture.write(mip.tobytes(), level=level, alignment=1)
        return texture

    @contextmanager
    def drawing(self, draw_list: AnyDrawList) -> Iterator[None]:
        """Use another draw list within the block, then the previous one again."""
        before = self._draw_list
        self.upload(draw_list)
        try:
            yield
        finally:
            if before is not None:
                self.upload(before)

    def upload(self, draw_list: AnyDrawList) -> None:
        """Set the draw list, and upload its commands unless the GPU has written them."""
        self._draw_list, self._ranges = draw_list, draw_list.ranges
        if isinstance(draw_list, GpuDrawList):
            return
        data = draw_list.commands.tobytes()
        if data:
            if self._commands is None or self._commands.size < len(data):
                what = f"draw commands of {self._scene.name}"
                made = self._memory.buffer(what, reserve=len(data) * 2, dynamic=True)
                if self._commands is not None:
                    self._commands.release()
                self._commands = made
            replace_content(self._commands, data)

    def bind_materials(self) -> None:
        """Bind the materials to their storage binding."""
        self._context.bind_storage(self._materials, int(StorageBinding.MATERIALS))

    def upload_materials(self) -> None:
        """Upload the changed records of the materials."""
        self._materials.write(self.materials.tobytes())

    def draw(self, opaque: moderngl.Program, alpha_tested: moderngl.Program) -> None:
        """Draw the current list: opaque buckets with one program, buckets with an alpha test with the other."""
        gl, draw_list = self._gl, self._draw_list
        for number, (bucket, first, count) in enumerate(self._ranges):
            needs_alpha = bucket.alpha_texture >= -1
            if needs_alpha:
                self._alpha_texture(bucket.alpha_texture).use(int(TextureUnit.ALPHA))
                self._samplers.get(bucket.alpha_sampler or Sampler()).use(int(TextureUnit.ALPHA))
            (gl.disable if bucket.double_sided else gl.enable)(moderngl.CULL_FACE)
            gl.front_face = "cw" if bucket.mirrored else "ccw"
            array = self._vertex_array(alpha_tested if needs_alpha else opaque)
            if isinstance(draw_list, GpuDrawList):
                draw_list.draw(array, self._index_bytes, number)
            elif self._context.features.compute:
                assert self._commands is not None
                array.render_indirect(self._commands, moderngl.TRIANGLES, count=count, first=first)
            else:
                self._draw_one_by_one(array, first, count)
            if needs_alpha:
                self._samplers.get(bucket.alpha_sampler or Sampler()).clear(int(TextureUnit.ALPHA))
        gl.disable(moderngl.CULL_FACE)
        gl.front_face = "ccw"

    def _draw_one_by_one(self, array: moderngl.VertexArray, first: int, count: int) -> None:
        """Draw commands one by one, for OpenGL 4.1, which has no indirect draws with a base instance."""
        assert isinstance(self._draw_list, DrawList)
        call = self._context.functions
        call("glUseProgram", array.program.glo)
        call("glBindVertexArray", array.glo)
        kind = GL_UNSIGNED_INT if self._index_bytes == 4 else GL_UNSIGNED_SHORT
        for command in self._draw_list.commands[first : first + count]:
            row = self._rows[command["base_instance"]]
            # Without an array, an attribute has one value for all vertices.
            for number, values in enumerate(row["transform"].tolist()):
                call("glVertexAttrib4f", FIRST_INSTANCE_LOCATION + number, *values)
            call("glVertexAttribI4ui", FIRST_INSTANCE_LOCATION + 3, int(row["ids"]), 0, 0, 0)
            call("glVertexAttrib4f", FIRST_INSTANCE_LOCATION + 4, float(row["aspect"]), 0.0, 0.0, 0.0)
            indices, place = int(command["count"]), self._index_bytes * int(command["first_index"])
            call("glDrawElementsBaseVertex", GL_TRIANGLES, indices, kind, place, int(command["base_vertex"]))

    def release(self) -> None:
        """Free everything."""
        self._samplers.release()
        for array in self._arrays.values():
            array.release()
        for texture in self._alpha.values():
            texture.release()
        for vertices in self._optional.values():
            vertices.release()
        for buffer in (self._vertices, self._colors, self._indices, self._instances, self._materials, self._commands):
            if buffer is not None:
                buffer.release()


@dataclass(frozen=True)
class CulledScene:
    """Inputs of the visibility pass: a view, and the draw list in the scene buffers. Equal for equal views."""

    camera: Camera
    size: tuple[int, int]
    """(width, height) in pixels."""
    matrix: NDArray[np.float64] = field(compare=False)
    """[4, 4] float64, world to clip."""
    draw_list: AnyDrawList = field(compare=False)
    sample: int = 0
    """Number of the pattern of thresholds that BLEND surfaces are drawn against, 0 to 15."""
    coverage: int = 0
    """Version of the textures' coverage (`SceneBuffers.coverage`)."""
