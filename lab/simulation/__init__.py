"""A simulated cluster that encodes a library: what it costs, and where it breaks first (docs/reports/scale.md)."""
