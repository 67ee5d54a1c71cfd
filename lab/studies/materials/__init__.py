"""Whole materials: maps encoded together, each alone, and in the formats of graphics hardware."""
