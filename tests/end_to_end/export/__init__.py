"""Exporters, by the command line."""
