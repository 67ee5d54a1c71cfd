"""The extensions of glTF that the reader knows."""

from typing import Final

SUPPORTED: Final = frozenset(
    {
        "EXT_mesh_gpu_instancing",
        "EXT_meshopt_compression",
        "EXT_texture_astc",
        "EXT_texture_avif",
        "EXT_texture_webp",
        "KHR_draco_mesh_compression",
        "KHR_lights_punctual",
        "KHR_materials_clearcoat",
        "KHR_materials_emissive_strength",
        "KHR_materials_ior",
        "KHR_materials_pbrSpecularGlossiness",
        "KHR_materials_specular",
        "KHR_materials_transmission",
        "KHR_materials_unlit",
        "KHR_materials_variants",
        "KHR_mesh_quantization",
        "KHR_meshopt_compression",
        "KHR_node_visibility",
        "KHR_texture_basisu",
        "KHR_texture_transform",
        "MSFT_texture_dds",
        "NV_texture_swizzle",
    }
)
"""Extensions that are drawn as specified. A file may require them."""

WITHOUT_EFFECT: Final = frozenset(
    {
        "EXT_instance_features",
        "EXT_lights_ies",
        "EXT_lights_image_based",
        "EXT_mesh_features",
        "EXT_mesh_manifold",
        "EXT_structural_metadata",
        "GODOT_single_root",
        "KHR_animation_pointer",
        "KHR_audio_emitter",
        "KHR_interactivity",
        "KHR_materials_anisotropy",
        "KHR_materials_diffuse_transmission",
        "KHR_materials_dispersion",
        "KHR_materials_iridescence",
        "KHR_materials_sheen",
        "KHR_materials_volume",
        "KHR_materials_volume_scatter",
        "KHR_node_hoverability",
        "KHR_node_selectability",
        "KHR_xmp",
        "KHR_xmp_json_ld",
        "MSFT_lod",
        "VRMC_springBone",
        "VRMC_vrm",
    }
)
"""Extensions that are ignored without harm: finer effects of light, other shapes of lights, behaviour and metadata.
A file may require them."""
