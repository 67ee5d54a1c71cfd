"""Panels and widgets, which read the state and emit commands. They call neither OpenGL nor torch."""
