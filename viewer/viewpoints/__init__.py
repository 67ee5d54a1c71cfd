"""Viewpoints of a scene: sampled ones, the first view, and the views that a grouping is chosen for."""
