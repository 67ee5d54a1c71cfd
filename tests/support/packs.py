"""Packs with random content, for tests that only need something to decode: those that the benchmarks decode."""

from lab.bench.random_pack import random_pack

__all__ = ["random_pack"]
