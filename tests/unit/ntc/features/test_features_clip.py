"""CLIP's features, with a stand-in for open_clip: what weights are asked for, and what is said without them."""

import importlib.abc
import importlib.machinery
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import save_file
from torch import nn

from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from ntc.features import FeatureOptions, feature_matrix
from ntc.features.clip import LENGTH, MODEL


class Encoder(nn.Module):
    """An image encoder with the inputs and outputs of ViT-B/32, and far fewer numbers between."""

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(3, 4, 32, 32)
        self.proj = nn.Parameter(torch.randn(196, LENGTH))

    def forward(self, images: torch.Tensor) -> torch.Tensor:
        """[N, 3, 224, 224] to [N, 512]."""
        assert tuple(images.shape[1:]) == (3, 224, 224)
        return self.conv1(images).flatten(1) @ self.proj


class Clip(nn.Module):
    """Both towers."""

    def __init__(self, embed_dim: int = LENGTH) -> None:
        super().__init__()
        self.visual = Encoder()
        self.text = nn.Linear(2, 2)


class OpenClip(ModuleType):
    """The part of open_clip that is used; remembers what it was asked to load."""

    def __init__(self) -> None:
        super().__init__("open_clip")
        self.loaded: list[tuple[str, str]] = []
        self.offline = False

    CLIP = Clip

    def get_model_config(self, name: str) -> dict[str, Any]:
        """The arguments of CLIP."""
        assert name == MODEL
        return {"embed_dim": LENGTH}

    def create_model(self, name: str, pretrained: str) -> Clip:
        """A model with weights from the network."""
        if self.offline:
            raise OSError("no route\nto host")
        self.loaded.append((name, pretrained))
        torch.manual_seed(1)
        return Clip()


@pytest.fixture
def open_clip(monkeypatch: pytest.MonkeyPatch) -> OpenClip:
    """Stands in for the package."""
    module = OpenClip()
    monkeypatch.setitem(sys.modules, "open_clip", module)
    return module


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    """A file of weights as open_clip publishes them."""
    torch.manual_seed(0)
    path = tmp_path / "open_clip_model.safetensors"
    save_file(Clip().state_dict(), path)
    return path


def textures() -> list[SourceTexture]:
    """Textures of several shapes."""
    random = np.random.default_rng(0)
    shapes = [(32, 32, 3), (1, 1, 1), (40, 8, 4), (300, 2, 2)]
    images = [random.integers(0, 256, shape, dtype=np.uint8) for shape in shapes]
    return [SourceTexture(str(image.shape), image, hash_pixels(image)) for image in images]


def refused(options: FeatureOptions) -> str:
    """What is said when features by CLIP are asked for."""
    with pytest.raises(InputError) as error:
        feature_matrix("clip", textures(), options)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_features_of_a_file(open_clip: OpenClip, weights: Path, tmp_path: Path) -> None:
    options = FeatureOptions(clip_weights=str(weights))
    matrix = feature_matrix("clip", textures(), options)
    assert matrix.shape == (4, LENGTH)
    assert np.isfinite(matrix).all()
    assert np.sum(matrix**2, axis=1).mean() == pytest.approx(1.0)
    np.testing.assert_array_equal(matrix, feature_matrix("clip", textures(), options))
    assert open_clip.loaded == []

    wrapped = tmp_path / "checkpoint.pt"
    torch.manual_seed(0)
    named = {f"module.{name}": value for name, value in Clip().state_dict().items()}
    torch.save({"epoch": 3, "state_dict": named}, wrapped)
    np.testing.assert_array_equal(matrix, feature_matrix("clip", textures(), FeatureOptions(clip_weights=str(wrapped))))


def test_download_happens_when_it_is_asked_for(open_clip: OpenClip) -> None:
    matrix = feature_matrix("clip", textures(), FeatureOptions(clip_weights="download"))
    assert matrix.shape == (4, LENGTH)
    assert open_clip.loaded == [(MODEL, "openai")]


def test_a_failed_download_is_one_line(open_clip: OpenClip) -> None:
    open_clip.offline = True
    assert refused(FeatureOptions(clip_weights="download")).startswith(
        "clip_weights download: failed (no route to host); fetch open_clip_model.safetensors"
    )


def test_the_cache_knows_the_weights(
    open_clip: OpenClip, weights: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "cache"
    kept = FeatureOptions(cache=folder, clip_weights=str(weights))
    matrix = feature_matrix("clip", textures(), kept)
    assert len(list(folder.iterdir())) == 4
    with monkeypatch.context() as patch:
        patch.setattr(open_clip, "get_model_config", None)
        np.testing.assert_array_equal(matrix, feature_matrix("clip", textures(), kept))
    torch.manual_seed(5)
    save_file(Clip().state_dict(), weights)
    assert np.abs(feature_matrix("clip", textures(), kept) - matrix).max() > 1e-3
    assert len(list(folder.iterdir())) == 8


def test_without_weights_both_ways_to_get_them_are_said(open_clip: OpenClip) -> None:
    message = refused(FeatureOptions())
    assert "--clip-weights FILE with open_clip_model.safetensors" in message
    assert "https://huggingface.co/timm/vit_base_patch32_clip_224.openai" in message
    assert message.endswith("or --clip-weights download")
    assert open_clip.loaded == []


def test_without_the_package_the_extra_is_named(weights: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "open_clip", None)
    message = refused(FeatureOptions(clip_weights=str(weights)))
    assert message.endswith("pip install 'ntc-viewer[clip]'")


def test_a_path_that_is_not_there(open_clip: OpenClip, tmp_path: Path) -> None:
    missing = str(tmp_path / "none.safetensors")
    assert refused(FeatureOptions(clip_weights=missing)).startswith(f"clip_weights {missing}: cannot be read (No such")
    assert "cannot be read (Is a directory)" in refused(FeatureOptions(clip_weights=str(tmp_path)))


class _Runs:
    """Pickled, it would make a file when it is loaded."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        return Path.touch, (self.path,)


@pytest.mark.parametrize(
    "fault", ["text", "cut", "other network", "shapes", "pickle", "list", "not a number", "no tensor"]
)
def test_a_file_that_does_not_fit(open_clip: OpenClip, weights: Path, tmp_path: Path, fault: str) -> None:
    path, touched = tmp_path / "w.pt", tmp_path / "touched"
    state: dict[str, Any] = dict(Clip().state_dict())
    if fault == "text":
        path.write_text("weights")
    elif fault == "cut":
        path = tmp_path / "w.safetensors"
        path.write_bytes(weights.read_bytes()[:5000])
    elif fault == "other network":
        torch.save({"conv1.weight": torch.zeros(3)}, path)
    elif fault == "shapes":
        torch.save({**state, "visual.proj": torch.zeros(3, 3)}, path)
    elif fault == "pickle":
        torch.save({"state_dict": _Runs(touched)}, path)
    elif fault == "list":
        torch.save([1, 2], path)
    elif fault == "no tensor":
        torch.save({**state, "visual.proj": "text"}, path)
    else:
        torch.save({**state, "visual.proj": state["visual.proj"] * float("nan")}, path)
    message = refused(FeatureOptions(clip_weights=str(path)))
    assert message.startswith(f"{path}: ")
    assert "give open_clip_model.safetensors" in message
    assert not touched.exists()


class _Mismatch(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """An open_clip whose torchvision was built for another torch."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        return importlib.machinery.ModuleSpec(fullname, self) if fullname == "open_clip" else None

    def exec_module(self, module: ModuleType) -> None:
        raise RuntimeError("operator torchvision::nms does not exist")


def test_a_torchvision_for_another_torch_is_named(weights: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "open_clip", raising=False)
    monkeypatch.setattr(sys, "meta_path", [_Mismatch(), *sys.meta_path])
    message = refused(FeatureOptions(clip_weights=str(weights)))
    assert "operator torchvision::nms does not exist" in message
    assert message.endswith(f"install the torchvision that belongs to torch {torch.__version__}")
