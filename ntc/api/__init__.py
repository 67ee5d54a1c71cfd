"""The functions of the library that nothing else in the package holds: arrays in, packs out, and back (docs/reference/api.md)."""
