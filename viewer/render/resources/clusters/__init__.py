"""Clusters of triangles: their bounds, and what Python and GLSL share of them."""
