"""Encoding in codec `block`: tables fitted to a group's textures, then codes found for each block."""
