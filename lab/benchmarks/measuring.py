"""The report of benchmarks, for those that still import it from here."""

from lab.runner import report

__all__ = ["report"]
