"""Codec `grid`: latents in grids, blended and read by a small network (the paper's codec, docs/reference/codecs.md)."""
