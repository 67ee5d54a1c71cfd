"""Animations, morph targets and skins of a glTF file."""
