"""A library on disk: encoded textures of many scenes in shards, each a pack, with an index (docs/reference/library-format.md)."""
