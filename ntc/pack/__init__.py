"""Packs and the `.ntc` files that hold them (docs/reference/pack-format.md)."""

PACK_SUFFIX = ".ntc"
