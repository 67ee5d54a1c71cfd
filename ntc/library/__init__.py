"""A library on disk: encoded textures of many scenes in shards, each a pack, with an index (docs/texture-library.md)."""
