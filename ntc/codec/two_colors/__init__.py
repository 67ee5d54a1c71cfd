"""Codec `two_colors`: two colours and an index of two bits a texel for each block of 4x4 texels."""
