"""Which glTF extensions are drawn as specified, which are known to change nothing here, which are not read."""

from viewer.scene.gltf.container import GltfFile, printable

SUPPORTED = frozenset(
    {
        "EXT_mesh_gpu_instancing",
        "EXT_texture_webp",
        "KHR_draco_mesh_compression",
        "KHR_materials_pbrSpecularGlossiness",
        "KHR_materials_unlit",
        "KHR_mesh_quantization",
        "KHR_texture_transform",
        "MSFT_texture_dds",
    }
)
"""Honoured: a file may require them."""

WITHOUT_EFFECT = frozenset(
    {
        "KHR_lights_punctual",
        "KHR_materials_anisotropy",
        "KHR_materials_clearcoat",
        "KHR_materials_dispersion",
        "KHR_materials_emissive_strength",
        "KHR_materials_ior",
        "KHR_materials_iridescence",
        "KHR_materials_sheen",
        "KHR_materials_specular",
        "KHR_materials_transmission",
        "KHR_materials_volume",
        "KHR_xmp_json_ld",
    }
)
"""Lighting, reflection and metadata: the picture is the base colour, so a file may require them and still be drawn."""

MOST_NAMED = 4
"""Extensions that one message names."""


def names_of(file: GltfFile, key: str) -> tuple[str, ...]:
    """The distinct names in "extensionsUsed" or "extensionsRequired", sorted. Raises InputError."""
    names = file.array(file.json, key, "file")
    for name in names:
        if not isinstance(name, str):
            raise file.fail(key, "must hold names")
    return tuple(sorted({printable(name) for name in names}))


def check_required(file: GltfFile) -> None:
    """Refuse a file that requires an extension which is not read. Raises InputError naming the extension."""
    missing = [n for n in names_of(file, "extensionsRequired") if n not in SUPPORTED and n not in WITHOUT_EFFECT]
    if missing:
        named = ", ".join(missing[:MOST_NAMED]) + (
            f" and {len(missing) - MOST_NAMED} more" * (len(missing) > MOST_NAMED)
        )
        raise file.fail("extensionsRequired", f"{named} is not supported; export the scene without it (uncompressed)")


def ignored_extensions(file: GltfFile) -> tuple[str, ...]:
    """Extensions in use that have no effect here, sorted. Raises InputError."""
    used = {*names_of(file, "extensionsUsed"), *names_of(file, "extensionsRequired")}
    return tuple(sorted(used - SUPPORTED))
