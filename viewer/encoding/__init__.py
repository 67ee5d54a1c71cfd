"""Encoding of thousands of textures by jobs in many processes: reading the textures, planning the jobs, and the result."""
