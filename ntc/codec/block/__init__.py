"""Codec `block`: texel blocks as trellis-coded coefficients of a linear transform that a group shares (docs/reference/codecs.md)."""
