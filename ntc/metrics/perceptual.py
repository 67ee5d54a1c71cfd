"""Perceptual differences of pictures: ColorVideoVDP and SSIMULACRA2, by their packages (extra `perceptual`)."""

import importlib
import importlib.util
import io
from functools import cache
from typing import Any

import numpy as np
from PIL import Image as PillowImage

from ntc.errors import InputError
from ntc.features.pixels import as_rgb
from ntc.metrics.image_quality import Image

DISPLAY = "standard_4k"
"""Display of ColorVideoVDP: 30 inches, 3840 x 2160, 200 cd/m2, seen from 0.75 m in an office."""
INSTALL = "pip install 'ntc-viewer[perceptual]'"


@cache
def has_jod() -> bool:
    """Return whether ColorVideoVDP is installed."""
    return importlib.util.find_spec("pycvvdp") is not None


@cache
def has_ssimulacra2() -> bool:
    """Return whether SSIMULACRA2 is installed."""
    return importlib.util.find_spec("ssimulacra2") is not None


def _module(name: str, title: str) -> Any:
    try:
        return importlib.import_module(name)
    except Exception as error:  # It imports torchvision, which raises RuntimeError beside another torch.
        reason = " ".join(str(error).split())
        raise InputError(f"{title}: {name} cannot be imported ({reason}); {INSTALL}") from error


@cache
def _visual_difference_predictor() -> Any:
    return _module("pycvvdp", "JOD").cvvdp(display_name=DISPLAY)


def jod(reference: Image, test: Image) -> float:
    """Return the quality of `test` in just-objectionable differences (Mantiuk et al. 2024, ColorVideoVDP): 10 equal, lower worse.

    Pictures are [H, W, C] uint8 sRGB, as for `flip`, on DISPLAY. Raises InputError if the package cannot be imported.
    """
    pictures = [np.ascontiguousarray(as_rgb(picture)) for picture in (test, reference)]
    quality, _ = _visual_difference_predictor().predict(*pictures, dim_order="HWC")
    return float(quality)


def ssimulacra2(reference: Image, test: Image) -> float:
    """Return SSIMULACRA2 (Sneyers 2023) of two pictures [H, W, C] uint8 sRGB: 100 equal, 90 hardly seen, 50 seen by everybody.

    Raises InputError if the package cannot be imported.
    """
    files = []
    for picture in (reference, test):
        # The package's only function reads files.
        file = io.BytesIO()
        PillowImage.fromarray(np.ascontiguousarray(as_rgb(picture))).save(file, "PNG", compress_level=1)
        files.append(file)
    return float(_module("ssimulacra2", "SSIMULACRA2").compute_ssimulacra2(*files))
