"""Export of a pack's decoder as source for other programs (`export --shader`), translated from the viewer's shaders."""
