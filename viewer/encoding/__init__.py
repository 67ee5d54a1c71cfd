"""Encoding thousands of textures as jobs that run in many processes: what there is, what a job is, and what came of all."""
