"""Mesh primitives gathered into shared vertex and index arrays.

Normals and tangents are only normalised here, never computed. Where the file has none, or one without a direction, the vertex
stores zero. Shaders then take the normal of the triangle, and the tangent from the screen-space derivatives of positions and UVs
(docs/explanation/lighting.md): no vertices need be split, and morphed and skinned meshes follow.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from viewer.scene.gltf import schema
from viewer.scene.gltf.buffers import Accessors, Buffers, normalize
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.draco import EXTENSION as DRACO
from viewer.scene.gltf.draco import DracoMesh, decode_draco
from viewer.scene.gltf.materials import MaterialSource, variant_materials, variant_names
from viewer.scene.gltf.motion.deformation import read_moving
from viewer.scene.gltf.textures import UvTransform
from viewer.scene.model import Geometry, Primitive
from viewer.scene.moving import Deformation, MovingVertices, VertexFrames
from viewer.scene.report import ReportNotes

SHORTEST = 1e-6
"""Vectors below this length have no direction."""

UNIT = 1e-5
"""Largest distance from 1 of squared lengths that count as 1."""


def _unit(vectors: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return ([N, 3] unit vectors of `vectors` [N, 3], zero where one has no direction; [N] whether each has a direction)."""
    with np.errstate(over="ignore", invalid="ignore"):
        squares = np.einsum("nc,nc->n", vectors, vectors)
        if bool((np.abs(squares - 1) < UNIT).all()):
            return vectors, np.ones(len(vectors), np.bool_)
    # Squares of large float32 values overflow float32.
    wide = vectors.astype(np.float64)
    lengths = np.sqrt(np.einsum("nc,nc->n", wide, wide))
    with np.errstate(invalid="ignore"):
        directed = (lengths >= SHORTEST) & np.isfinite(lengths)
    if directed.all():
        return (wide / lengths[:, None]).astype(np.float32), directed
    unit = np.zeros_like(vectors)
    unit[directed] = wide[directed] / lengths[directed, None]
    return unit, directed


def unit_normals(normals: NDArray[np.float32]) -> tuple[NDArray[np.float32], int]:
    """Return ([N, 3] unit vectors of `normals` [N, 3], zero where one is not finite or has no length; number of these)."""
    unit, directed = _unit(normals)
    return unit, int((~directed).sum())


def unit_tangents(tangents: NDArray[np.float32]) -> tuple[NDArray[np.float32], int]:
    """Return ([N, 4] `tangents` with unit xyz and a w of 1 or -1, all zero where xyz or w give no direction; number of these).

    A w between -1 and 1 counts by its sign: quantised files store such values (glTF 2.0, Sec. 3.7.2.1).
    """
    unit, directed = _unit(tangents[:, :3])
    directed &= np.isfinite(tangents[:, 3]) & (tangents[:, 3] != 0.0)
    signs = np.where(tangents[:, 3] < 0.0, np.float32(-1.0), np.float32(1.0))
    whole = np.concatenate([unit, signs[:, None]], axis=1)
    whole[~directed] = 0.0
    return whole, int((~directed).sum())


SHORT_INDICES = 1 << 16
"""Number of indices that two bytes can hold. A scene needs four only where a primitive has more vertices."""


def joined(
    parts: list[NDArray[np.float32] | None], counts: Sequence[int], components: int, absent: float = 0.0
) -> NDArray[np.float32] | None:
    """Return [sum of counts, components] float32: `parts` joined, `absent` in place of None; None when all are None.

    Each entry of `parts` is set to None once it is copied, so its memory is free.
    """
    if all(part is None for part in parts):
        return None
    whole = np.empty((sum(counts), components), np.float32)
    start = 0
    for number, count in enumerate(counts):
        part, parts[number] = parts[number], None
        whole[start : start + count] = absent if part is None else part
        start += count
    return whole


def joined_indices(
    parts: list[NDArray[Any] | None], total: int, highest: int
) -> NDArray[np.uint16] | NDArray[np.uint32]:
    """Return [total] the unsigned integers of `parts` joined, as uint16 where `highest` fits, else uint32.

    Each entry of `parts` is set to None once it is copied, so its memory is free.
    """
    whole: NDArray[Any] = np.empty(total, np.uint16 if highest < SHORT_INDICES else np.uint32)
    start = 0
    for number, part in enumerate(parts):
        if part is not None:
            parts[number] = None
            whole[start : start + len(part)] = part
            start += len(part)
    return whole


TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN = 4, 5, 6
"""glTF primitive modes."""
MODE_NAMES = {0: "points", 1: "lines", 2: "line loops", 3: "line strips"}
MAX_VALUES = 1 << 28
"""Most vertices, and most indices, of a whole scene."""
FREE_VALUES = 1 << 22
VALUES_PER_BYTE = 16
"""Limit of the vertices, and of the indices, of a file: FREE_VALUES, and VALUES_PER_BYTE for each byte of its buffers. More than
one a byte is possible: Draco compresses, and accessors may share bytes."""

_VertexKey = tuple[Any, ...]


def triangle_list(indices: NDArray[Any], mode: int) -> NDArray[Any]:
    """Return [3 T] indices of the triangles of a list, strip or fan `indices` [N] in `mode`, wound as glTF 2.0, Sec. 3.7.2.1 says.

    Left-over vertices are dropped, and so are degenerate triangles, with two equal corners, that join strips.
    """
    if mode == TRIANGLES:
        return indices[: len(indices) // 3 * 3]
    count = max(0, len(indices) - 2)
    step = np.arange(count)
    if mode == TRIANGLE_STRIP:
        odd = step % 2
        corners = np.stack([step, step + 1 + odd, step + 2 - odd], axis=1)
    elif mode == TRIANGLE_FAN:
        corners = np.stack([step + 1, step + 2, np.zeros_like(step)], axis=1)
    else:
        raise ValueError(f"mode {mode} is no triangle mode")
    triangles = indices[corners]
    if mode == TRIANGLE_STRIP:
        a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
        triangles = triangles[(a != b) & (b != c) & (a != c)]
    return np.ascontiguousarray(triangles).reshape(-1)


class GeometryReader:
    """Reads primitives one after another and joins them; `finish` returns the arrays.

    Primitives that share accessors share vertices and indices. Vertices are repeated only where materials of the same
    primitive data read different UV sets or transforms.
    """

    def __init__(
        self,
        file: GltfFile,
        buffers: Buffers,
        accessors: Accessors,
        materials: Sequence[MaterialSource],
        notes: ReportNotes,
        variant: int | None = None,
    ) -> None:
        """Start to read `file` for a material variant, by its number; None: the materials that primitives name themselves."""
        self._file = file
        self._variant = variant
        self._variants = len(variant_names(file))
        self.all_materials: set[int] = set()
        """Materials of the primitives read so far, under all variants."""
        self._buffers = buffers
        self._accessors = accessors
        self._materials = materials
        self._notes = notes
        self._positions: list[NDArray[np.float32] | None] = []
        self._uvs: list[NDArray[np.float32] | None] = []
        self._colors: list[NDArray[np.float32] | None] = []
        self._normals: list[NDArray[np.float32] | None] = []
        self._tangents: list[NDArray[np.float32] | None] = []
        self._second_uvs: list[NDArray[np.float32] | None] = []
        self._indices: list[NDArray[Any] | None] = []
        self._highest_index = 0
        self.moving: list[MovingVertices] = []
        """Vertices that skins and morph targets move."""
        self._target_values = 0
        self._vertex_count = 0
        self._index_count = 0
        self._vertex_ranges: dict[_VertexKey, tuple[int, int]] = {}
        self._index_ranges: dict[_VertexKey, tuple[int, int, int]] = {}

    def read_mesh(self, index: int, deformation: Deformation | None = None) -> tuple[Primitive, ...]:
        """Return the triangle primitives of mesh `index`, moved as a node's `deformation` says. Raises InputError."""
        name = self._file.label(self._file.entries("meshes")[index], f"mesh {index}")
        primitives: list[Primitive] = []
        for number, entry in enumerate(self._file.entry("meshes", index, schema.Mesh).primitives):
            field = f"meshes[{index}].primitives[{number}]"
            primitive = self._primitive(entry, field, f"{name}.{number}" if number else name, deformation)
            if primitive is not None:
                primitives.append(primitive)
        return tuple(primitives)

    def finish(self) -> Geometry:
        """Return all vertices and indices read so far. Frees the parts that were read: call it once, at the end."""
        counts = [0 if part is None else len(part) for part in self._positions]
        colors, normals = joined(self._colors, counts, 4, 1.0), joined(self._normals, counts, 3)
        tangents, second_uvs = joined(self._tangents, counts, 4), joined(self._second_uvs, counts, 2)
        indices = joined_indices(self._indices, self._index_count, self._highest_index)
        uvs, positions = joined(self._uvs, counts, 2), joined(self._positions, counts, 3)
        return Geometry(
            positions=np.zeros((0, 3), np.float32) if positions is None else positions,
            uvs=np.zeros((0, 2), np.float32) if uvs is None else uvs,
            colors=colors,
            indices=indices,
            normals=normals,
            tangents=tangents,
            second_uvs=second_uvs,
        )

    def _primitive(
        self, entry: schema.Primitive, where: str, name: str, deformation: Deformation | None
    ) -> Primitive | None:
        file, mode, attributes = self._file, int(entry.mode), entry.attributes
        if mode in MODE_NAMES:
            self._notes.ignored(f"primitives of {MODE_NAMES[mode]}")
            return None
        if "POSITION" not in attributes:
            self._notes.ignored("primitives without positions")
            return None
        self._note_unused(entry)
        material = len(self._materials) - 1
        if entry.material != schema.ABSENT:
            material = file.index(entry.material, len(self._materials) - 1, f"{where}.material")
        by_variant = variant_materials(file, entry, self._variants, where)
        every = {material, *by_variant.values()}
        if self._variant is not None:
            material = by_variant.get(self._variant, material)
        draco = None
        if DRACO in entry.extensions:
            draco = decode_draco(file, self._buffers, entry.extensions[DRACO], where)
            self._notes.honoured(f"{DRACO}: primitives")
        moved = None if deformation is None else (deformation, entry.targets)
        base, vertex_count = self._vertices(attributes, draco, self._materials[material], where, moved)
        first, index_count = self._triangles(entry, draco, mode, vertex_count, where)
        if index_count == 0:
            self._notes.note("primitives without a triangle were left out")
            return None
        self.all_materials |= every
        return Primitive(name, first, index_count, base, vertex_count, material)

    def _note_unused(self, entry: schema.Primitive) -> None:
        notes, attributes = self._notes, entry.attributes
        notes.honoured("morph targets: primitives", int(bool(entry.targets)))
        notes.honoured("skin weights: primitives", int("JOINTS_0" in attributes))
        notes.ignored("second vertex colours: primitives", int("COLOR_1" in attributes))
        notes.honoured("vertex colours: primitives", int("COLOR_0" in attributes))

    def _vertices(
        self,
        attributes: schema.Attributes,
        draco: DracoMesh | None,
        source: MaterialSource,
        where: str,
        moved: tuple[Deformation, tuple[schema.Attributes, ...]] | None,
    ) -> tuple[int, int]:
        """Return (base vertex, count) of the primitive's vertices, read once for equal attributes.

        `moved`: the deformation of its node and its morph targets; None for vertices that nothing moves.
        """
        transform = source.uvs.transform
        uv_name = f"TEXCOORD_{source.uvs.uv_set}"
        second_name = None if source.second_uv_set is None else f"TEXCOORD_{source.second_uv_set}"
        # Tangents belong to the UVs of the normal map. Without a normal map nothing reads them.
        tangent_name = "TANGENT" if "normal" in source.maps else None
        read = ("POSITION", uv_name, "COLOR_0", "NORMAL", tangent_name, second_name)
        accessors = (None if name is None else _index_or_none(attributes.get(name)) for name in read)
        key: _VertexKey = (*accessors, transform, tangent_name, second_name, moved and (moved[0].node, where))
        if draco is None and key in self._vertex_ranges:
            return self._vertex_ranges[key]
        positions = self._attribute("POSITION", attributes, draco, where, ("VEC3",), 3)
        assert positions is not None
        count = len(positions)
        self._vertex_count += count
        self._check_total(self._vertex_count, "vertices", where)
        uvs = self._uv(uv_name, attributes, draco, transform, source, count, where)
        second = None
        if second_name is not None:
            second = self._uv(second_name, attributes, draco, None, source, count, where)
        colors = self._attribute("COLOR_0", attributes, draco, where, ("VEC3", "VEC4"), None)
        if colors is not None:
            self._same_count(colors, count, f"{where}.attributes.COLOR_0")
            if colors.shape[1] == 3:
                colors = np.concatenate([colors, np.ones((count, 1), np.float32)], axis=1)
            colors = self._finite(colors, "vertex colours")
        frames = VertexFrames(
            positions,
            self._optional("NORMAL", attributes, draco, count, where, "normals of triangles are used"),
            self._optional("TANGENT", attributes, draco, count, where, "they follow from the UVs")
            if tangent_name
            else None,
        )
        if moved is not None:
            stored = partial(self._stored, attributes, draco, where)
            self._target_values += count * len(moved[1])
            self._check_total(self._target_values, "offsets of morph targets", where)
            base = self._vertex_count - count
            finite = replace(frames, positions=self._finite(frames.positions, "positions"))
            moving = read_moving(self._file, self._accessors, moved[1], stored, moved[0], where, finite, base)
            self.moving.append(moving)
            frames = moving.at(moved[0])
        self._positions.append(self._finite(frames.positions, "positions"))
        self._uvs.append(uvs)
        self._colors.append(colors)
        self._normals.append(self._normal(frames.normals))
        self._tangents.append(self._tangent(frames.tangents))
        self._second_uvs.append(second)
        place = (self._vertex_count - count, count)
        if draco is None:
            self._vertex_ranges[key] = place
        return place

    def _uv(
        self,
        name: str,
        attributes: schema.Attributes,
        draco: DracoMesh | None,
        transform: UvTransform | None,
        source: MaterialSource,
        count: int,
        where: str,
    ) -> NDArray[np.float32]:
        uvs = self._attribute(name, attributes, draco, where, ("VEC2",), 2)
        if uvs is None:
            if source.maps:
                self._notes.missing(f"{where}: no {name}, which {source.material.name} reads; 0, 0 is used")
            uvs = np.zeros((count, 2), np.float32)
        self._same_count(uvs, count, f"{where}.attributes.{name}")
        if transform is not None:
            with np.errstate(over="ignore", invalid="ignore"):
                uvs = transform.apply(uvs)
        return self._finite(uvs, "UVs")

    def _stored(
        self, attributes: schema.Attributes, draco: DracoMesh | None, where: str, name: str
    ) -> NDArray[Any] | None:
        """Return [count, 4] of an attribute in its stored type; None when the primitive has no such attribute."""
        if name not in attributes:
            return None
        if draco is not None and name in draco.attributes:
            return draco.attributes[name]
        return self._accessors.raw(attributes[name], f"{where}.attributes.{name}", ("VEC4",))

    def _normal(self, normals: NDArray[np.float32] | None) -> NDArray[np.float32] | None:
        """Return [count, 3] unit normals, zero where one of the file has no direction."""
        if normals is None:
            return None
        self._notes.honoured("vertex normals: primitives")
        unit, broken = unit_normals(normals)
        if broken:
            self._notes.repaired(f"normals without a direction in {broken} vertices; that of the triangle is used")
        return unit

    def _tangent(self, tangents: NDArray[np.float32] | None) -> NDArray[np.float32] | None:
        """Return [count, 4] unit tangents and signs, zero where one of the file has no direction."""
        if tangents is None:
            return None
        self._notes.honoured("vertex tangents: primitives")
        unit, broken = unit_tangents(tangents)
        if broken:
            self._notes.repaired(f"tangents without a direction in {broken} vertices; they follow from the UVs")
        return unit

    def _optional(
        self, name: str, attributes: schema.Attributes, draco: DracoMesh | None, count: int, where: str, instead: str
    ) -> NDArray[np.float32] | None:
        """Return `_attribute` of normals or tangents. Faults are only reported, because a picture can do without them."""
        kind, components = ("VEC3", 3) if name == "NORMAL" else ("VEC4", 4)
        try:
            values = self._attribute(name, attributes, draco, where, (kind,), components)
            if values is not None:
                self._same_count(values, count, f"{where}.attributes.{name}")
        except InputError as error:
            self._notes.repaired(f"{str(error).removeprefix(f'{self._file.name}: ')} [{instead}]")
            return None
        return values

    def _attribute(
        self,
        name: str,
        attributes: schema.Attributes,
        draco: DracoMesh | None,
        where: str,
        kinds: tuple[str, ...],
        components: int | None,
    ) -> NDArray[np.float32] | None:
        """Return [count, components] float32; None when the primitive has no such attribute."""
        if name not in attributes:
            return None
        field = f"{where}.attributes.{name}"
        accessor = attributes[name]
        is_color = name.startswith("COLOR")
        if draco is None or name not in draco.attributes:
            if is_color:
                # Integer colours are always normalised, whatever the accessor says.
                return normalize(self._accessors.raw(accessor, field, kinds))
            return self._accessors.floats(accessor, field, kinds)
        values = draco.attributes[name]
        if (components is not None and values.shape[1] != components) or (is_color and values.shape[1] not in (3, 4)):
            raise self._file.fail(field, f"the Draco data has {values.shape[1]} components")
        number = self._file.index(accessor, len(self._file.entries("accessors")), field)
        if is_color or self._file.entry("accessors", number, schema.Accessor).normalized is True:
            return normalize(values)
        return values.astype(np.float32)

    def _triangles(
        self, entry: schema.Primitive, draco: DracoMesh | None, mode: int, vertex_count: int, where: str
    ) -> tuple[int, int]:
        """Return (first index, count) of the primitive's triangles, read once for equal index accessors."""
        file = self._file
        has_indices = entry.indices != schema.ABSENT
        key = (entry.indices, mode, None if has_indices else vertex_count)
        if draco is None and key in self._index_ranges:
            first, count, highest = self._index_ranges[key]
        else:
            if draco is not None:
                indices, mode = draco.indices, TRIANGLES
            elif has_indices:
                raw = self._accessors.raw(entry.indices, f"{where}.indices", ("SCALAR",))
                if raw.dtype.kind != "u":
                    raise file.fail(f"{where}.indices", "must be unsigned integers")
                indices = raw[:, 0]
            else:
                indices = np.arange(vertex_count, dtype=np.uint32)
                self._notes.honoured("primitives without indices")
            if mode != TRIANGLES:
                self._notes.honoured("triangle strips and fans: primitives")
            triangles = triangle_list(indices, mode)
            first, count = self._index_count, len(triangles)
            highest = int(triangles.max()) if count else 0
            self._index_count += count
            self._check_total(self._index_count, "indices", where)
            self._highest_index = max(self._highest_index, highest)
            self._indices.append(triangles)
            if draco is None:
                self._index_ranges[key] = first, count, highest
        if count and highest >= vertex_count:
            raise file.fail(f"{where}.indices", f"index {highest} out of range: there are {vertex_count} vertices")
        return first, count

    def _check_total(self, total: int, what: str, where: str) -> None:
        most = min(MAX_VALUES, FREE_VALUES + VALUES_PER_BYTE * self._buffers.byte_count)
        if total > most:
            raise self._file.fail(
                where, f"the scene has more than {most} {what} in {self._buffers.byte_count} bytes; split it"
            )

    def _same_count(self, values: NDArray[Any], count: int, where: str) -> None:
        if len(values) != count:
            raise self._file.fail(where, f"has {len(values)} elements for {count} positions")

    def _finite(self, values: NDArray[np.float32], what: str) -> NDArray[np.float32]:
        broken = ~np.isfinite(values)
        if not broken.any():
            return values
        self._notes.repaired(f"{what} that are NaN or infinite in {int(broken.any(axis=1).sum())} vertices; 0 is used")
        return np.where(broken, np.float32(0), values)


def _index_or_none(value: Any) -> int | None:
    return value if isinstance(value, int) else None
