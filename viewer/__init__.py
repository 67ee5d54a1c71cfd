"""The viewer: glTF scenes drawn with textures that are decoded from neural latents in GLSL."""

__version__ = "0.2.0"
