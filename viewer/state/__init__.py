"""What is open and how it is looked at, as plain data. No OpenGL, no UI."""
