"""Checks of encoded scenes: measured values, a budget of limits, findings, and reports for people and for CI services."""
