"""Packs and the `.ntc` files that hold them (docs/pack-format.md)."""
