"""Decode path `on-load`: textures are decoded once, compressed on the GPU to the blocks that its texture units read, and sampled."""
