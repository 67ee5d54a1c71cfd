"""How far decoded values can be from exact ones (docs/explanation/accuracy.md)."""
