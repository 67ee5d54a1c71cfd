"""Bounds of the distance between decoded values and exact ones (docs/explanation/accuracy.md)."""
