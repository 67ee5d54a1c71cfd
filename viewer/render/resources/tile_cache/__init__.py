"""Decode path `cached`: pages, tables, budget and pass."""
