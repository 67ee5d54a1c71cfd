"""What the window's panels tell about a scene and its packs, as tables without a window. Knows neither OpenGL nor ImGui."""
