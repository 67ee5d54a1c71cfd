"""Checks of encoded scenes: measured values, a budget of limits, what passed them, and reports for people and for CI services."""
