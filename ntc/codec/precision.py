"""The precisions in which decoders are stored and computed."""

from typing import Literal

Precision = Literal["fp32", "fp16", "fp16-arithmetic", "fp16-accumulate"]
"""fp32; weights stored as halves; besides, products in halves; besides, sums in halves."""
PrecisionChoice = Literal["auto", "fp32", "fp16", "fp16-arithmetic", "fp16-accumulate"]
"""A precision, or the cheapest one that does not show (`ntc.accuracy.precision_choice`)."""
LARGEST_HALF = 65504.0
"""Largest finite half."""
