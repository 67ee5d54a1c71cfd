"""Accuracy of decoding: certified error bounds, rescaling, and the choice of a precision (docs/explanation/accuracy.md)."""
