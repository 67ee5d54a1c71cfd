"""Training: reproducible, frozen when it should be, good enough on easy textures, and stoppable."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from ntc.codec.config import WrapMode
from ntc.codec.grid.model import GridConfig, grid_parts
from ntc.codec.grid.torch_twin import AdapterStack, DecoderStack
from ntc.codec.grid.training.config import FreezingConfig, TrainingConfig, recipe_codec, recipe_config
from ntc.codec.latents import latent_levels
from ntc.codec.mips import mip_chain
from ntc.codec.model import Grouping, Pack
from ntc.codec.quality import psnr_db
from ntc.codec.reference import decode_image
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError, TrainingCancelledError
from ntc.pack.file import read_pack, write_pack
from ntc.torch_device import choose_device
from ntc.training.encode import encode_textures
from ntc.training.messages import TrainingProgress
from tests.support.textures import arrays, of_pixels, same, texture

SHORT = TrainingConfig(steps=12, texels_per_texture=64, device="cpu", seed=5)
SMALL = GridConfig(hidden_width=16)
PAIR = Grouping("single", (0, 0))


def own_decoders(count: int) -> Grouping:
    """The baseline grouping of `count` textures."""
    return Grouping("baseline", tuple(range(count)))


def decoder_arrays(pack: Pack) -> list[NDArray[np.float32]]:
    """All decoder arrays of a pack."""
    return [array for decoder in grid_parts(pack).decoders for array in (*decoder.weights, *decoder.biases)]


def unchanged(before: Sequence[NDArray[np.float32]], after: Sequence[NDArray[np.float32]]) -> bool:
    """Whether all arrays are equal bit by bit."""
    return all(np.array_equal(x, y) for x, y in zip(before, after, strict=True))


ADAPTED = replace(SMALL, adapters=True)
OWN_OUTPUT = replace(SMALL, adapters=True, adapter_output=True)
FOUR_BITS = replace(SMALL, latent_channels=8, latent_bits=4)
KINDS = {
    "plain": SMALL,
    "one level": replace(SMALL, levels=1),
    "adapters": ADAPTED,
    "output layers": OWN_OUTPUT,
    "four bits": FOUR_BITS,
    "halves": replace(SMALL, weight_bits=16),
}


def is_half(values: NDArray[np.float32]) -> bool:
    return np.array_equal(values, values.astype(np.float16).astype(np.float32))


@pytest.fixture(scope="module", params=KINDS)
def trained(request: pytest.FixtureRequest) -> tuple[str, list[SourceTexture], Pack]:
    """(kind, textures, their pack under one decoder)."""
    wraps: list[tuple[WrapMode, WrapMode]] = [("repeat", "mirror"), ("clamp", "repeat")]
    textures = [replace(texture(16, 16, seed=seed), wrap=wrap) for seed, wrap in enumerate(wraps)]
    return request.param, textures, encode_textures(textures, PAIR, KINDS[request.param], SHORT)


def test_a_pack_comes_back_from_its_file_and_is_measured_as_it_is_stored(
    trained: tuple[str, list[SourceTexture], Pack], tmp_path: Path
) -> None:
    kind, textures, pack = trained
    write_pack(tmp_path / "a.ntc", pack)
    read = read_pack(tmp_path / "a.ntc")
    assert same(pack, read)
    assert read.training == pack.training
    for index, given in enumerate(textures):
        assert (read.textures[index].wrap, read.textures[index].pixel_hash) == (given.wrap, given.pixel_hash)
        assert read.textures[index].psnr_db == pack.textures[index].psnr_db
        measured = psnr_db(decode_image(read, index), given.pixels)
        assert pack.textures[index].psnr_db == pytest.approx(measured, abs=0.1)
    write_pack(tmp_path / "b.ntc", encode_textures(textures, PAIR, KINDS[kind], SHORT))
    assert (tmp_path / "a.ntc").read_bytes() == (tmp_path / "b.ntc").read_bytes()
    assert not same(pack, encode_textures(textures, PAIR, KINDS[kind], replace(SHORT, seed=6)))


def test_a_pack_holds_what_its_settings_say(trained: tuple[str, list[SourceTexture], Pack]) -> None:
    kind, _, pack = trained
    own, (decoder,) = grid_parts(pack).textures, grid_parts(pack).decoders
    if kind == "halves":
        assert all(is_half(values) for values in decoder_arrays(pack))
    if kind == "four bits":
        assert own[0].latents.max() == 15
        assert own[0].latents.shape[1] == 8
    if kind not in ("adapters", "output layers"):
        assert all(each.adapter is None for each in own)
        return
    adapters = [each.adapter for each in own if each.adapter is not None]
    assert len(adapters) == 2
    for adapter in adapters:
        for values in (adapter.scales, adapter.biases):
            assert values.shape == (2, 16)
            assert is_half(values)
        assert np.abs(adapter.scales - 1.0).max() > 1e-3
        assert np.abs(adapter.biases).max() > 1e-3
    # The biases of hidden layers are the adapters' now, and so may be the output layer.
    assert not decoder.biases[0].any()
    assert not decoder.biases[1].any()
    outputs = [adapter.output_weight for adapter in adapters if adapter.output_weight is not None]
    assert len(outputs) == (2 if kind == "output layers" else 0)
    assert decoder.weights[2].any() == (kind == "adapters")
    assert not outputs or (outputs[0].shape == (3, 16) and not np.array_equal(outputs[0], outputs[1]))


@pytest.mark.parametrize("levels", [None, 1])
def test_odd_textures_of_different_channels_share_a_decoder(levels: int | None) -> None:
    random = np.random.default_rng(0)
    images = [
        np.zeros((16, 16, 3), np.uint8),
        np.full((16, 16, 3), 255, np.uint8),
        np.full((1, 1, 2), 90, np.uint8),
        random.integers(0, 256, (1, 4096, 1), np.uint8),
        random.integers(0, 256, (4096, 1, 4), np.uint8),
        texture(33, 17, 3, seed=1).pixels,
    ]
    sources = [of_pixels(pixels, str(number)) for number, pixels in enumerate(images)]
    sources[-1] = replace(sources[-1], color_space="linear")
    training = TrainingConfig(steps=60, texels_per_texture=32, device="cpu")
    grouping = Grouping("clustered", (0, 0, 1, 1, 0, 1))
    pack = encode_textures(sources, grouping, recipe_codec("best", 4, levels), training)
    assert all(np.isfinite(array).all() for array in arrays(pack))
    for index, each in enumerate(sources):
        decoded = decode_image(pack, index)
        assert decoded.shape == each.pixels.shape
        assert pack.textures[index].channels == each.channels
        assert pack.textures[index].psnr_db is not None
        # Black and white are far apart, though they share a decoder.
        if index < 2:
            assert np.abs(decoded.astype(int) - each.pixels).mean() < 60


@pytest.mark.parametrize(
    ("textures", "groups", "words"),
    [
        ([], (), "no texture"),
        ([texture(8, 8, 4)], (0,), "4 channels"),
        ([texture(8, 8)], (0, 0), "grouping"),
        ([texture(8, 8), texture(8, 8)], (0, 2), "grouping"),
        *(
            ([SourceTexture("odd", pixels, "0")], (0,), "textures are 8-bit")  # type: ignore[arg-type]
            for pixels in (np.zeros((4, 4, 3), np.float32), np.zeros((0, 4, 3), np.uint8), np.zeros((4, 4), np.uint8))
        ),
    ],
)
def test_what_cannot_be_trained_is_bad_input(
    textures: list[SourceTexture], groups: tuple[int, ...], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        encode_textures(textures, Grouping("random", groups), SMALL, SHORT)


def smooth_texture(side: int) -> SourceTexture:
    """One slow wave a channel: 16 latent cells a period at 64 texels a side."""
    u = 2.0 * np.pi * (np.arange(side) + 0.5) / side
    v, flat = u[:, None], np.zeros((side, side))
    planes = [0.5 + 0.4 * np.sin(u + flat), 0.5 + 0.3 * np.cos(v + flat), 0.5 + 0.2 * np.sin(u + v)]
    return of_pixels(np.rint(np.stack(planes, axis=-1) * 255).astype(np.uint8), "smooth")


@pytest.mark.slow
def test_a_smooth_texture_is_learnt_well() -> None:
    smooth = smooth_texture(64)
    training = TrainingConfig(steps=500, texels_per_texture=512, decoder_rate=1e-2, device="cpu")
    pack = encode_textures([smooth], own_decoders(1), GridConfig(), training)
    measured = pack.textures[0].psnr_db
    assert measured is not None
    assert measured > 35.0
    assert psnr_db(decode_image(pack, 0), smooth.pixels) == pytest.approx(measured, abs=0.1)
    # Every level is trained, not mip 0 alone.
    for level, mip in enumerate(mip_chain(smooth.pixels, "srgb")[: len(latent_levels(64, 64, GridConfig()))]):
        assert psnr_db(decode_image(pack, 0, level), mip) > 30.0


def watched_decoders(monkeypatch: pytest.MonkeyPatch, training: TrainingConfig) -> list[list[NDArray[np.float32]]]:
    """The decoder's arrays as each step of a training on one texture finds them, and last as the pack holds them."""
    seen: list[list[NDArray[np.float32]]] = []
    layers = DecoderStack.layers

    def watched(self: DecoderStack, *arguments: Any) -> Any:
        if torch.is_grad_enabled():
            exported = self.export()[0]
            seen.append([*exported.weights, *exported.biases])
        return layers(self, *arguments)

    with monkeypatch.context() as patch:
        patch.setattr(DecoderStack, "layers", watched)
        pack = encode_textures([texture(16, 16)], own_decoders(1), SMALL, training)
    return [*seen, decoder_arrays(pack)]


def test_freezing_scales_the_updates_and_then_ends_them(monkeypatch: pytest.MonkeyPatch) -> None:
    free = replace(SHORT, steps=20, schedule="constant", rounded_share=0.0)
    freezing = replace(free, freezing=FreezingConfig(start=0.5, duration=0.2))
    moving, slowing = watched_decoders(monkeypatch, free), watched_decoders(monkeypatch, freezing)
    assert len(moving) == len(slowing) == 21
    for step in range(12):
        assert unchanged(moving[step], slowing[step]), "e_s is at step 10, where the scale is still 1"
    # Step 11 lies a quarter into T and starts from equal weights, so that the updates differ by the scale alone.
    scale = 0.5 * (1.0 + np.cos(np.pi / 4.0))
    for start, full, less in zip(moving[11], moving[12], slowing[12], strict=True):
        np.testing.assert_allclose(less - start, scale * (full - start), atol=1e-6)
    assert not unchanged(slowing[13], slowing[14])
    for later in slowing[15:]:
        assert unchanged(slowing[14], later), "e_s + T is at step 14"


def test_cancelling_raises_and_delivers_nothing() -> None:
    asked: list[int] = []

    def cancelled() -> bool:
        asked.append(1)
        return len(asked) >= 4

    with pytest.raises(TrainingCancelledError):
        encode_textures([texture(8, 8)], own_decoders(1), SMALL, SHORT, cancelled=cancelled)
    assert len(asked) == 4


@pytest.mark.parametrize("per_group", [None, 32])
def test_progress_ends_with_the_last_step(per_group: int | None) -> None:
    reports: list[TrainingProgress] = []
    textures = [texture(16, 16), texture(8, 8, seed=1)]
    pack = encode_textures(
        textures, own_decoders(2), SMALL, replace(SHORT, texels_per_group=per_group), progress=reports.append
    )
    assert reports[-1].step == reports[-1].steps == pack.training["steps"] == 12 * (1 if per_group is None else 2)
    trained = [report.step for report in reports if report.work == "training step"]
    assert trained == sorted(trained)
    measured = [(report.step, report.steps) for report in reports if report.work == "measuring texture"]
    shares = [report.share for report in reports]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert all(report.share < 1.0 for report in reports[:-1]), "not before the last texture is measured"
    assert set(measured) <= {(1, 2), (2, 2)}
    for report in reports:
        values = (report.mean_psnr_db, report.ktexels_per_second, *report.losses.values())
        assert np.isfinite(values).all()
        assert report.freezing_scale == 1.0


def test_the_paper_recipe_runs() -> None:
    training = replace(recipe_config("paper"), epochs=1.0, texels_per_group=64, device="cpu")
    textures = [texture(16, 16), texture(8, 16, seed=1), texture(8, 8, seed=2)]
    pack = encode_textures(textures, Grouping("clustered", (0, 1, 0)), GridConfig(levels=1), training)
    # Group 0 holds 256 + 64 texels at 2 x 32 a step, group 1 holds 128 at 64 a step.
    assert pack.training["steps"] == 5 + 2
    assert pack.training["recipe"] == "paper"


@pytest.mark.skipif(torch.cuda.is_available(), reason="this machine has a CUDA device")
def test_cuda_that_is_not_there_is_bad_input() -> None:
    assert choose_device("auto").type == "cpu"
    with pytest.raises(InputError, match="--device cuda"):
        choose_device("cuda")


def test_numbers_beyond_half_precision_are_stored_as_its_largest() -> None:
    config = GridConfig(hidden_width=4, adapters=True, adapter_output=True, weight_bits=16)
    decoders, adapters = DecoderStack(config, 1, torch.Generator()), AdapterStack(config, 1)
    with torch.no_grad():
        for part in (*adapters.scales, *adapters.biases, *adapters.output, *decoders.weights):
            part.fill_(-1e6)
    (adapter,) = adapters.export(decoders, torch.zeros(1, dtype=torch.int64))
    (decoder,) = decoders.export()
    assert adapter.output_weight is not None
    for found in (adapter.scales, adapter.biases, adapter.output_weight, decoder.weights[0]):
        assert (found == -65504.0).all()


@pytest.mark.slow
def test_what_is_learnt_already_drops_out_and_stays_as_it_is() -> None:
    flat, waves = np.full((16, 16, 3), 128, np.uint8), texture(16, 16, seed=4)
    sources = [of_pixels(flat, "flat"), waves]
    training = TrainingConfig(steps=400, texels_per_texture=64, device="cpu", converged_db=50.0)
    pack = encode_textures(sources, own_decoders(2), SMALL, training)
    assert pack.training["converged_textures"] >= 1
    assert np.abs(decode_image(pack, 0).astype(int) - 128).max() <= 2
    without = encode_textures(sources, own_decoders(2), SMALL, replace(training, steps=60, converged_db=None))
    assert without.training["converged_textures"] == 0
