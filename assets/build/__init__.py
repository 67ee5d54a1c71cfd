"""Scripts that make the built-in scene from nothing but numbers. They are not shipped in the wheel."""
