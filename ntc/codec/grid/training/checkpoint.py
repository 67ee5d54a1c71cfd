"""The file that holds a training under way, to continue it later: safetensors, like packs."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from ntc.codec.grid.config import GridConfig
from ntc.codec.grid.training.config import TrainingConfig
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.io import file_metadata, read_file, write_bytes

METADATA_KEY = "ntc_training"
GENERATOR = "generator"
REMEDY = "remove it, or name another file"


@dataclass(frozen=True)
class BatchProgress:
    """What the state of a batch holds besides its tensors."""

    rate_factor: float
    dropped: int


@dataclass(frozen=True, eq=False)
class TrainingState:
    """A training between two steps."""

    batches: Sequence[Mapping[str, Tensor]]
    progress: Sequence[BatchProgress]
    generator: Tensor
    """State of the random generator, bytes."""
    seconds: float
    """Trained so far."""


def training_settings(
    textures: Sequence[SourceTexture], grouping: Grouping, codec: GridConfig, training: TrainingConfig
) -> dict[str, Any]:
    """What must be equal for a training to continue from a state."""
    return {
        "codec": asdict(codec),
        "training": asdict(training),
        "groups": list(grouping.groups),
        "textures": [[t.pixel_hash, *t.size, t.color_space, *t.wrap] for t in textures],
        "torch": torch.__version__,
    }


def save_state(path: Path, state: TrainingState, settings: Mapping[str, Any]) -> None:
    """Write a state atomically. Raises InputError where it cannot be written."""
    tensors = {
        f"{number}/{name}": value.contiguous()
        for number, batch in enumerate(state.batches)
        for name, value in batch.items()
    }
    record = {
        "settings": settings,
        "progress": [asdict(progress) for progress in state.progress],
        "seconds": state.seconds,
    }
    tensors[GENERATOR] = state.generator
    copies = {name: value.detach().cpu().clone() for name, value in tensors.items()}
    write_bytes(path, save(copies, metadata={METADATA_KEY: json.dumps(record)}))


def load_state(path: Path, settings: Mapping[str, Any]) -> TrainingState:
    """A state that was saved with the same settings. Raises InputError for any other file."""
    try:
        data = read_file(path)
        tensors = load(data)
        record = json.loads(file_metadata(data)[METADATA_KEY])
        known = json.loads(json.dumps(settings))
        other = sorted(key for key in known if record["settings"].get(key) != known[key])
        if other:
            raise InputError(f"{path}: is the state of another training (it differs in {', '.join(other)}); {REMEDY}")
        progress = tuple(BatchProgress(**entry) for entry in record["progress"])
        batches: list[dict[str, Tensor]] = [{} for _ in progress]
        for name, tensor in tensors.items():
            number, _, key = name.partition("/")
            if key:
                batches[int(number)][key] = tensor
        return TrainingState(batches, progress, tensors[GENERATOR], float(record["seconds"]))
    except (SafetensorError, OSError, ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
        raise InputError(f"{path}: is not the state of a training ({error}); {REMEDY}") from error
