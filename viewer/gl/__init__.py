"""OpenGL plumbing that knows nothing of scenes: context, programs, buffers, texture arrays, timers."""
