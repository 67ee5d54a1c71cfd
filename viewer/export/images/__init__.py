"""Formats that images of an exported scene are stored in."""
