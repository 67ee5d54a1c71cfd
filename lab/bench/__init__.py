"""Benchmarks that `ntc-viewer bench` runs."""
