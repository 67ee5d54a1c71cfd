"""The neural texture codec: latent grids and small decoders. Knows numpy and torch, never OpenGL or a window."""
