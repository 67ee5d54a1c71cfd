"""Drawing of a view of a scene: the renderer, its passes and the resources that they read."""
