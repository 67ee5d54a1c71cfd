"""Certified bounds hold: on random and hostile weights, in every precision, against arithmetic that rounds step by step."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc.codec.config import Precision
from ntc.codec.grid.accuracy.error_bound import running_bounds, texture_bounds
from ntc.codec.grid.accuracy.precision_choice import (
    HALF_STEP,
    chosen_precision,
    decode_texels_in_half,
    measured_error,
    sampled_bound,
)
from ntc.codec.grid.accuracy.rescale import Exponents, exponents, rescaled_pack, stored_pack
from ntc.codec.grid.model import GridConfig, GridDecoder, grid_parts
from ntc.codec.grid.reference import decoder_inputs, run_decoder
from ntc.codec.latents import latent_levels
from ntc.codec.model import Pack
from ntc.codec.reference import decode_texels

TEXELS = 100_000
SMALL = GridConfig(hidden_width=16)
ADAPTED = GridConfig(
    hidden_width=16, latent_channels=8, latent_bits=4, adapters=True, adapter_output=True, weight_bits=16
)
ALL: tuple[Precision, ...] = ("fp32", "fp16", "fp16-arithmetic", "fp16-accumulate")
Change = Callable[[np.ndarray], np.ndarray]


def with_layers(pack: Pack, changes: tuple[Change, Change, Change], biases: bool = True) -> Pack:
    """`pack` with the weights of each layer changed, and its biases too."""

    def changed(decoder: GridDecoder) -> GridDecoder:
        weights = tuple(change(w).astype(np.float32) for change, w in zip(changes, decoder.weights, strict=True))
        own = tuple(change(b).astype(np.float32) for change, b in zip(changes, decoder.biases, strict=True))
        return GridDecoder(weights, own if biases else decoder.biases)

    return replace(pack, decoders=tuple(changed(decoder) for decoder in grid_parts(pack).decoders))


def times(exponent: int) -> Change:
    return lambda values: np.ldexp(values, exponent)


def same(values: np.ndarray) -> np.ndarray:
    return values


def overflowing(pack: Pack) -> Pack:
    """The same function with hidden values beyond 65504."""
    first, second, third = times(15), times(2), times(-17)
    inner = with_layers(pack, (first, second, same), biases=False)
    by = (
        [np.ldexp(d.biases[0], 15) for d in grid_parts(pack).decoders],
        [np.ldexp(d.biases[1], 17) for d in grid_parts(pack).decoders],
    )
    decoders = tuple(
        GridDecoder(
            (d.weights[0], d.weights[1], third(d.weights[2]).astype(np.float32)),
            (by[0][i].astype(np.float32), by[1][i].astype(np.float32), d.biases[2]),
        )
        for i, d in enumerate(grid_parts(inner).decoders)
    )
    return replace(inner, decoders=decoders)


PLAIN = random_pack(((64, 64), (17, 33)), (0, 1), SMALL)
CASES: dict[str, Pack] = {
    "plain": PLAIN,
    "adapted": random_pack(((64, 64), (17, 33)), (0, 1), ADAPTED),
    "one texel": random_pack(((1, 1), (300, 2)), (0, 1), SMALL),
    "2^20": with_layers(PLAIN, (times(20), times(20), times(20))),
    "2^-20": with_layers(PLAIN, (times(-20), times(-20), times(-20))),
    "2^20 then 2^-20": with_layers(PLAIN, (times(20), times(-20), same)),
    "denormal halves": with_layers(PLAIN, (times(-14), times(14), same)),
    "overflowing": overflowing(PLAIN),
    "cancelling": with_layers(PLAIN, (same, same, lambda values: values - values.mean())),
}


def places(pack: Pack, texture: int, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Random fp32 places on and around the texture, and levels of detail within and beyond it."""
    random = np.random.default_rng(seed)
    levels = len(latent_levels(pack.textures[texture].width, pack.textures[texture].height, pack.config))
    uv, lod = random.uniform(-2.0, 2.0, (count, 2)), random.uniform(-1.0, levels, count)
    return uv.astype(np.float32).astype(np.float64), lod.astype(np.float32).astype(np.float64)


def single_decode(pack: Pack, texture: int, uv: np.ndarray, lod: np.ndarray, halves: bool) -> np.ndarray:
    """The network in fp32, one product after the other, from float64 inputs rounded once."""
    encoded = grid_parts(pack).textures[texture]
    decoder = grid_parts(pack).decoders[encoded.group]
    values = decoder_inputs(pack, encoded, uv, lod, encoded.wrap).astype(np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        for layer, parameters in enumerate(zip(decoder.weights, decoder.biases, strict=True)):
            weight, bias = parameters
            if halves:
                weight, bias = (np.clip(w, -65504, 65504).astype(np.float16).astype(np.float32) for w in parameters)
            sums = np.broadcast_to(bias, (len(values), len(bias))).astype(np.float32)
            for column in range(weight.shape[1]):
                sums = sums + values[:, column, None] * weight[:, column]
            values = np.maximum(sums, np.float32(grid_parts(pack).config.leaky_slope) * sums) if layer < 2 else sums
    return np.clip(np.nan_to_num(values, nan=0.0), 0.0, 1.0)[:, : encoded.channels]


@pytest.mark.parametrize("precision", ALL)
@pytest.mark.parametrize("case", CASES)
def test_bounds_hold(case: str, precision: Precision) -> None:
    pack = CASES[case]
    stored = stored_pack(pack, precision)
    bounds = texture_bounds(pack, precision)
    # Halves are slow to round one by one: the whole number of texels over all cases of a precision.
    count = TEXELS // (2 * len(CASES))
    for texture in range(len(pack.textures)):
        uv, lod = places(pack, texture, count, seed=texture)
        exact = decode_texels(pack, texture, uv, lod)
        if precision in ("fp16-arithmetic", "fp16-accumulate"):
            found = decode_texels_in_half(stored, texture, uv, lod, precision == "fp16-accumulate", rescale=False)
        elif grid_parts(pack).config.adapters:
            continue
        else:
            found = single_decode(stored, texture, uv, lod, halves=precision == "fp16")
        running = running_bounds(stored, texture, uv, lod, precision)
        error = np.abs(found - exact)
        assert np.isfinite(found).all()
        assert (error <= running).all(), f"{error.max()} beyond the bound of its texel"
        assert running.max() <= bounds[texture].error * (1.0 + 1e-6)


def test_the_bound_of_activations_holds() -> None:
    pack = CASES["overflowing"]
    activations = texture_bounds(pack, "fp32")[0].activations
    uv, lod = places(pack, 0, 2000, 0)
    texture, decoder = grid_parts(pack).textures[0], grid_parts(pack).decoders[0]
    values = decoder_inputs(pack, texture, uv, lod, texture.wrap)
    for layer in range(3):
        sums = values @ decoder.weights[layer].T.astype(np.float64) + decoder.biases[layer]
        assert np.abs(sums).max() <= activations[layer]
        values = np.where(sums > 0.0, sums, sums * grid_parts(pack).config.leaky_slope)


@pytest.mark.parametrize("config", [SMALL, ADAPTED], ids=["plain", "adapted"])
def test_rescaling_changes_no_exact_value(config: GridConfig) -> None:
    pack = random_pack(((64, 64), (17, 33)), (0, 0), config)
    pack = with_layers(pack, (times(18), times(3), same))
    found = rescaled_pack(pack)
    assert found is not pack
    for texture, encoded in enumerate(grid_parts(pack).textures):
        uv, lod = places(pack, texture, 500, texture)
        inputs = decoder_inputs(pack, encoded, uv, lod, encoded.wrap)
        results = [
            run_decoder(own.decoders[0], inputs, config.leaky_slope, own.textures[texture].adapter)
            for own in map(grid_parts, (pack, found))
        ]
        assert np.array_equal(results[0], results[1]), "powers of two are exact"
    assert max(texture_bounds(found, "fp16-accumulate", rescale=False)[0].activations[:2]) < 65504.0


def test_packs_in_range_are_left_alone() -> None:
    assert exponents(PLAIN) == [Exponents(), Exponents()]
    assert rescaled_pack(PLAIN) is PLAIN
    assert stored_pack(CASES["overflowing"], "fp32") is CASES["overflowing"]
    assert stored_pack(PLAIN, "fp16") is PLAIN


@pytest.mark.parametrize("precision", ["fp16-arithmetic", "fp16-accumulate"])
def test_rescaling_prevents_overflow(precision: Precision) -> None:
    pack = CASES["overflowing"]
    accumulate = precision == "fp16-accumulate"
    uv, lod = places(pack, 0, 2000, 0)
    exact = decode_texels(pack, 0, uv, lod)
    without = decode_texels_in_half(pack, 0, uv, lod, accumulate, rescale=False)
    assert np.isfinite(without).all(), "what is no number is 0"
    assert np.abs(without - exact).max() > 0.2
    assert np.abs(decode_texels_in_half(pack, 0, uv, lod, accumulate) - exact).max() < 1e-2
    assert texture_bounds(pack, precision, rescale=False)[0].overflows
    assert not texture_bounds(pack, precision)[0].overflows


def test_what_is_measured_must_leave_room_for_what_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    pack = CASES["adapted"]
    halves: tuple[Precision, ...] = ("fp16-accumulate", "fp32")
    for share, chosen in ((0.3, "fp16-accumulate"), (0.5, "fp32")):
        monkeypatch.setattr(
            "ntc.codec.grid.accuracy.precision_choice.measured_error", lambda *_, share=share: share * HALF_STEP
        )
        assert chosen_precision(pack, halves).precision == chosen


def test_the_cheapest_precision_that_does_not_show() -> None:
    trained = replace(CASES["adapted"])
    only: tuple[Precision, ...] = ("fp32",)
    assert chosen_precision(trained, only).precision == "fp32"
    assert chosen_precision(trained, ("fp16", "fp32")).precision == "fp16", "its weights are halves"
    assert chosen_precision(trained, ALL[::-1], limit=1.0).precision == "fp16-accumulate"
    assert chosen_precision(trained, ALL, limit=1.0).precision == "fp32", "nothing is faster"
    assert chosen_precision(CASES["2^20"], ALL[::-1]).precision == "fp32", "sums overflow"
    for precision in ALL[2:]:
        measured = measured_error(trained, precision, 256)
        assert 0.0 < measured < sampled_bound(trained, precision, 256)
