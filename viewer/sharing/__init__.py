"""Comparison of groupings: what sharing decoders costs and saves, trained at equal steps, samples and bits."""
