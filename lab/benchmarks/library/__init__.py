"""Benchmarks of libraries of encoded textures."""
