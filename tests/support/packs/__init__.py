"""Helpers of tests with packs."""
