"""Features `clip`: embeddings of CLIP's image encoder, ViT-B/32 with OpenAI's weights, by open_clip.

The user names a file of weights, or asks for their download.
"""

import hashlib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features.efficientnet import square_images
from ntc.features.extractor import Extractor, centred_directions

LENGTH = 512
INPUT_SIDE = 224
MODEL = "ViT-B-32-quickgelu"
"""OpenAI trained with the quick approximation of GELU; open_clip's plain ViT-B-32 is for other weights."""
DOWNLOAD = "download"
WEIGHTS_FROM = "open_clip_model.safetensors (605 MB) of https://huggingface.co/timm/vit_base_patch32_clip_224.openai"

_MEAN = (0.48145466, 0.4578275, 0.40821073)
_DEVIATION = (0.26862954, 0.26130258, 0.27577711)
_PREFIX = "visual."


def _open_clip() -> ModuleType:
    try:
        import open_clip
    except ImportError as error:
        raise InputError(
            f"features clip: open_clip cannot be imported ({error}); pip install 'ntc-viewer[clip]'"
        ) from error
    # torchvision raises these if it was built for another torch.
    except (RuntimeError, OSError) as error:
        raise InputError(
            f"features clip: open_clip does not start ({error}); install the torchvision that belongs to "
            f"torch {torch.__version__}"
        ) from error
    module: ModuleType = open_clip
    return module


def _read_weights(path: Path) -> Mapping[str, Any]:
    remedy = f"give {WEIGHTS_FROM}"
    try:
        if path.suffix == ".safetensors":
            from safetensors.torch import load_file

            content: Any = load_file(path)
        else:
            content = torch.load(path, map_location="cpu", weights_only=True)
    # For a broken file, both libraries raise many kinds of exceptions, pickle's among them.
    except Exception as error:
        raise InputError(f"{path}: cannot be read as weights; {remedy}") from error
    if isinstance(content, Mapping) and isinstance(content.get("state_dict"), Mapping):
        content = content["state_dict"]
    if not isinstance(content, Mapping):
        raise InputError(f"{path}: holds no named weights; {remedy}")
    names = {str(name).removeprefix("module."): value for name, value in content.items()}
    return {name.removeprefix(_PREFIX): value for name, value in names.items() if name.startswith(_PREFIX)}


def load_image_encoder(weights: str) -> Any:
    """Load CLIP's image encoder on the CPU, ready to infer: images [N, 3, 224, 224] to [N, 512].

    `weights` is a path or "download". Raises InputError for weights that are missing, unreadable or of another network.
    """
    open_clip = _open_clip()
    if weights == DOWNLOAD:
        try:
            encoder = open_clip.create_model(MODEL, pretrained="openai").visual
        # Errors of the network, the hub's client or the disk, of many kinds.
        except Exception as error:
            raise InputError(
                f"clip_weights download: failed ({error}); fetch {WEIGHTS_FROM} yourself and name the file"
            ) from error
    else:
        values = _read_weights(Path(weights))
        # create_model would warn that weights are random; the next lines load them.
        encoder = open_clip.CLIP(**open_clip.get_model_config(MODEL)).visual
        try:
            encoder.load_state_dict(values)
        except (RuntimeError, TypeError, AttributeError) as error:
            raise InputError(f"{weights}: not the weights of CLIP ViT-B/32; give {WEIGHTS_FROM}") from error
        if not all(bool(torch.isfinite(numbers).all()) for numbers in encoder.parameters()):
            raise InputError(f"{weights}: holds numbers that are not finite; give {WEIGHTS_FROM}")
    encoder.eval()
    return encoder


def embeddings(encoder: Any, textures: Sequence[SourceTexture]) -> NDArray[np.float64]:
    """Return [textures, 512] float64: the embedding of each texture by `encoder`, not normalised."""
    mean, deviation = (torch.tensor(values).reshape(1, 3, 1, 1) for values in (_MEAN, _DEVIATION))
    images = (square_images(textures, INPUT_SIDE, "bicubic") - mean) / deviation
    with torch.no_grad():
        embedded = encoder(images)
    return np.asarray(embedded.float().numpy(), np.float64)


def _weights_identity(weights: str) -> str:
    if weights == DOWNLOAD:
        return "openai"
    try:
        with Path(weights).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()[:32]
    except OSError as error:
        raise InputError(f"clip_weights {weights}: cannot be read ({error.strerror}); check the path") from error


def clip_extractor(weights: str | None) -> Extractor:
    """Return the extractor of features `clip`. The encoder is loaded when the first texture is not in the cache.

    `weights` is a path or "download". Raises InputError at once if it is None, if the file cannot be read, and if open_clip is
    missing.
    """
    if weights is None:
        raise InputError(
            f"features clip: no weights given; --clip-weights FILE with {WEIGHTS_FROM}, or --clip-weights download"
        )
    identity = _weights_identity(weights)
    _open_clip()
    encoder = cache(lambda: load_image_encoder(weights))
    return Extractor(
        "clip",
        f"vit-b-32-1-{identity}",
        LENGTH,
        16,
        centred_directions,
        lambda textures: embeddings(encoder(), textures),
    )
