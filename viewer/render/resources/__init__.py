"""GPU resources that passes read and write: scene and pack buffers, latents, targets, tables, and their layout."""
