"""Training in the background of the window: settings, preparation, the run under way, and the log of runs. No OpenGL, no torch."""
