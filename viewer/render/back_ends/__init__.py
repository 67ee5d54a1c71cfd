"""Back ends that decode lists of texels by other means than GLSL, for paths `cached` and `binned`. Imported only when asked for."""

import importlib
from typing import Final

from ntc.errors import InputError
from viewer.render.resources.texel_lists import MakeListDecoder
from viewer.state.view_state import DecodeWith

_MODULES: Final = {"torch": "cuda_lists", "torch-cpu": "torch_lists"}


def list_decoders(name: DecodeWith) -> MakeListDecoder | None:
    """What makes the decoders of `name`; None for GLSL. Imports torch for the others, and needs a current OpenGL context.

    Raises InputError where torch is not installed, or lacks CUDA.
    """
    if name == "glsl":
        return None
    try:
        module = importlib.import_module(f"viewer.render.back_ends.{_MODULES[name]}")
    except ModuleNotFoundError as error:
        raise InputError(f"decoding with {name}: {error.name} is not installed; pip install torch==2.13.0") from error
    found: MakeListDecoder = module.make_lists()
    return found
