"""Export as glTF: a copy of the scene's file whose textures also name the pack that encodes them (NV_texture_swizzle)."""
