"""Panels and widgets: they read state and emit commands. No OpenGL calls, no torch."""
