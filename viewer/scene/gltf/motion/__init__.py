"""What moves nodes and vertices: animations, morph targets, skins."""
