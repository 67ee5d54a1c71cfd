"""KHR_materials_variants: named alternatives of which material a primitive has."""

from collections.abc import Mapping
from typing import Any

from ntc.errors import InputError
from viewer.scene.gltf.container import GltfFile

EXTENSION = "KHR_materials_variants"
MOST_NAMED = 6
"""Variants that one message names."""


def variant_names(file: GltfFile) -> tuple[str, ...]:
    """Names of the file's variants, in its order; a number stands for a variant without a name of its own. Raises InputError."""
    extension = file.extension(file.json, EXTENSION, "file") or {}
    where = f"extensions.{EXTENSION}"
    names: list[str] = []
    for number, entry in enumerate(file.array(extension, "variants", where)):
        if not isinstance(entry, dict):
            raise file.fail(f"{where}.variants[{number}]", "must be an object")
        name = file.label(entry, f"variant {number}")
        names.append(name if name not in names else f"variant {number}")
    return tuple(names)


def chosen_variant(names: tuple[str, ...], wanted: str, scene: str) -> int | None:
    """Number of the variant called `wanted`; None for "", the materials that primitives name themselves. Raises InputError."""
    if not wanted:
        return None
    if wanted not in names:
        known = ", ".join(names[:MOST_NAMED]) + (f" and {len(names) - MOST_NAMED} more" * (len(names) > MOST_NAMED))
        there = f"there are {known}" if names else "the scene has no variants"
        raise InputError(f"{scene}: no variant {wanted!r}; {there}")
    return names.index(wanted)


def variant_materials(file: GltfFile, primitive: Mapping[str, Any], variants: int, where: str) -> dict[int, int]:
    """Material by number of variant, for those of the `variants` of the file that a primitive names. Raises InputError."""
    extension = file.extension(primitive, EXTENSION, where)
    if extension is None:
        return {}
    where = f"{where}.{EXTENSION}.mappings"
    materials: dict[int, int] = {}
    for number, mapping in enumerate(file.array(extension, "mappings", where)):
        field = f"{where}[{number}]"
        if not isinstance(mapping, dict):
            raise file.fail(field, "must be an object")
        material = file.index(mapping.get("material"), len(file.entries("materials")), f"{field}.material")
        for variant in file.array(mapping, "variants", field):
            materials.setdefault(file.index(variant, variants, f"{field}.variants"), material)
    return materials
