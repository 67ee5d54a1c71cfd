"""A copy of a scene's glTF file in which textures also name the pack that they are encoded in (NV_texture_swizzle)."""
