"""Capture of pictures and films as files."""
