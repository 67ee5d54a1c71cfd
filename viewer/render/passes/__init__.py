"""Render passes: one pass, one file, one shader folder, one test."""
