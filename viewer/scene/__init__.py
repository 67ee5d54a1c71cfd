"""glTF files as plain data: geometry, materials, textures, cameras and a load report. No OpenGL."""
