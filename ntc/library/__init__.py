"""A library: a folder of packs of many scenes, with an index (docs/reference/library-format.md)."""
