"""Pixels of textures: where they come from, and how many stay in memory."""
