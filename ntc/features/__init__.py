"""Descriptions of textures as vectors, by which groupings find what is alike."""
