"""The device that trains, and the memory that training takes."""

import sys

import torch

from ntc.errors import InputError


def choose_device(name: str) -> torch.device:
    """Return the torch device for `auto`, `cpu` or `cuda`. Raises InputError for CUDA where torch has none."""
    if name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    if name == "cuda" and not torch.cuda.is_available():
        raise InputError(
            "--device cuda: this torch has no CUDA device; see README for the CUDA build, or use --device cpu"
        )
    return torch.device(name)


def peak_memory_bytes(device: torch.device) -> int | None:
    """Return the most memory that this process has held, of the GPU for CUDA. None where the system does not report it."""
    if device.type == "cuda":
        return int(torch.cuda.max_memory_allocated(device))
    try:
        import resource
    except ImportError:
        # Windows.
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak) if sys.platform == "darwin" else int(peak) * 1024
