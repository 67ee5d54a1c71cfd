"""`export --shader`: the decoder of a pack as source for other programs, made from the viewer's own shaders."""
