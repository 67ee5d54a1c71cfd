"""Encoding in codec `block`: tables are fitted to a group's textures, then each block is coded under them."""
