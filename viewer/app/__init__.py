"""The window, and its content without a window."""
