"""The file that holds a training under way, to continue it later: safetensors, like packs."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from ntc.codec.encoding import EncodingOptions
from ntc.codec.model import CodecSettings, Grouping
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.io import file_metadata, read_file, write_bytes

METADATA_KEY = "ntc_training"
REMEDY = "remove it, or name another file"


def state_settings(
    textures: Sequence[SourceTexture], grouping: Grouping, codec: CodecSettings, options: EncodingOptions
) -> dict[str, Any]:
    """What must be equal for a training to continue from a state."""
    return {
        "codec": asdict(cast(Any, codec)),
        "training": asdict(cast(Any, options)),
        "groups": list(grouping.groups),
        "textures": [[t.pixel_hash, *t.size, t.color_space, *t.wrap] for t in textures],
        "torch": torch.__version__,
    }


def save_state(path: Path, state: Mapping[str, Tensor], settings: Mapping[str, Any]) -> None:
    """Write a state atomically. Raises InputError where it cannot be written."""
    copies = {name: value.detach().cpu().contiguous().clone() for name, value in state.items()}
    write_bytes(path, save(copies, metadata={METADATA_KEY: json.dumps({"settings": settings})}))


def load_state(path: Path, settings: Mapping[str, Any]) -> dict[str, Tensor]:
    """A state that was saved with the same settings. Raises InputError for any other file."""
    try:
        data = read_file(path)
        tensors: dict[str, Tensor] = load(data)
        found = json.loads(file_metadata(data)[METADATA_KEY])["settings"]
        known = json.loads(json.dumps(settings))
        other = sorted(key for key in known if found.get(key) != known[key])
    except (SafetensorError, OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: is not the state of a training ({error}); {REMEDY}") from error
    if other:
        raise InputError(f"{path}: is the state of another training (it differs in {', '.join(other)}); {REMEDY}")
    return tensors
