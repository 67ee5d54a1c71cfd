"""RenderContext a view of a scene: the renderer, its passes and what they read."""
