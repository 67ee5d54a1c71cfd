"""Codec `grid`: grids of latents that a small network decodes (the paper's codec, docs/reference/codec-grid.md)."""
