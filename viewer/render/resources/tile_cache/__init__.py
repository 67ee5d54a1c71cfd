"""Tile cache of decode path `cached`: tiles and pages, budget, GPU work."""
