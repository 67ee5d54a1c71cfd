"""Scenes of many textures: made here, opened, drawn, measured."""
