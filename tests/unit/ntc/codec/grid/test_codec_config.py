"""Checks and derived sizes of GridConfig."""

from typing import Any

import pytest

from ntc.codec.grid.model import GridConfig


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("latent_channels", 0), ("latent_channels", 3), ("latent_channels", 20), ("latent_channels", -4),
        ("downscale", 0), ("downscale", 65), ("levels", 0), ("levels", 17), ("levels", -1),
        ("positional_octaves", 0), ("positional_octaves", 9), ("hidden_width", 0), ("hidden_width", 30),
        ("hidden_width", 260), ("leaky_slope", -0.1), ("leaky_slope", 1.0), ("leaky_slope", float("nan")),
        ("output_channels", 0), ("output_channels", 5), ("latent_bits", 5), ("latent_bits", 16),
        ("adapter_output", True), ("weight_bits", 8),
    ],
)  # fmt: skip
def test_bad_fields_are_named(field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=f"codec.{field} = "):
        GridConfig(**{field: value})


def test_sizes_of_the_paper() -> None:
    config = GridConfig(levels=1)
    assert config.decoder_inputs == 16
    assert config.layer_shapes == ((64, 16), (64, 64), (3, 64))
    assert config.multiply_adds == 5312


def test_several_levels_add_the_lod_input() -> None:
    assert GridConfig().decoder_inputs == 17
    assert GridConfig(levels=2, latent_channels=8, positional_octaves=2).decoder_inputs == 8 + 8 + 1


def test_eight_channels_of_four_bits_take_the_room_of_four_of_eight() -> None:
    narrow, wide = GridConfig(), GridConfig(latent_channels=8, latent_bits=4)
    assert narrow.cell_bytes == wide.cell_bytes == 4
    assert (narrow.largest_stored, wide.largest_stored) == (255, 15)
