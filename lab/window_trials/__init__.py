"""A trial of the real window on a virtual screen, for a long time."""
