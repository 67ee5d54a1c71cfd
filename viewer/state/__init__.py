"""State of the program as plain data: open files, view, settings. No OpenGL, no UI."""
