"""Trials of the real window on a virtual screen: random input for a long time, and a newcomer's first minute."""
