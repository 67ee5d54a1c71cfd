"""Synthetic scenes of many triangles: making them, opening them, drawing them."""
