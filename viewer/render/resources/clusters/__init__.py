"""Clusters of triangles: their bounds, and culling them on the GPU."""
