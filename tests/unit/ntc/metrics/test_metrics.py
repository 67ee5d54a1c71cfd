"""PSNR, its summary, and the table of a pack."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc.codec.grid.model import grid_parts
from ntc.codec.quality import PsnrSummary, mean_square_error, psnr_db
from ntc.metrics.metrics import psnr_table


def test_equal_pictures_have_infinite_psnr() -> None:
    picture = np.random.default_rng(0).integers(0, 256, (5, 6, 3), np.uint8)
    assert psnr_db(picture, picture.copy()) == math.inf


def test_a_known_error() -> None:
    a, b = np.zeros((4, 4, 3), np.uint8), np.full((4, 4, 3), 2, np.uint8)
    assert mean_square_error(a, b) == mean_square_error(b, a) == 4.0
    assert psnr_db(a, b) == pytest.approx(10.0 * math.log10(255.0**2 / 4.0))
    assert psnr_db(a, np.full_like(a, 255)) == pytest.approx(0.0)


def test_summary_of_known_values() -> None:
    summary = PsnrSummary.of([20.0, 30.0, 70.0])
    assert summary is not None
    assert (summary.mean_db, summary.median_db, summary.minimum_db) == (40.0, 30.0, 20.0)
    mean = (10**-2.0 + 10**-3.0 + 10**-7.0) / 3.0
    assert summary.of_mean_mse_db == pytest.approx(-10.0 * math.log10(mean))


def test_summary_of_nothing_is_none() -> None:
    assert PsnrSummary.of([]) is None


def test_summary_with_a_perfect_texture_stays_printable() -> None:
    summary = PsnrSummary.of([math.inf, 30.0])
    assert summary is not None
    assert summary.minimum_db == 30.0
    assert summary.of_mean_mse_db == pytest.approx(30.0 + 10.0 * math.log10(2.0))


def test_table_lists_the_worst_texture_first_and_counts_every_byte() -> None:
    pack = random_pack(sizes=((16, 16), (8, 8), (4, 4)), groups=(0, 1, 0))
    textures = tuple(
        replace(t, psnr_db=value) for t, value in zip(grid_parts(pack).textures, (40.0, 20.0, None), strict=True)
    )
    table = psnr_table(replace(pack, textures=textures))
    assert [line.split()[1] for line in table.lines()[1:4]] == ["1", "0", "2"]
    arrays = [a for t in textures for a in (t.latents, t.scale, t.offset)]
    decoders = [a for d in grid_parts(pack).decoders for a in (*d.weights, *d.biases)]
    assert table.latent_bytes == sum(a.nbytes for a in arrays)
    assert table.decoder_bytes == sum(a.nbytes for a in decoders)
    texels = 16 * 16 + 8 * 8 + 4 * 4
    assert table.bits_per_texel == pytest.approx(8 * (table.latent_bytes + table.decoder_bytes) / texels)
    assert table.summary is not None
    assert table.summary.mean_db == 30.0


def test_table_of_perfect_textures_is_json() -> None:
    pack = random_pack(sizes=((4, 4),), groups=(0,))
    table = psnr_table(replace(pack, textures=(replace(pack.textures[0], psnr_db=math.inf),)))
    document = json.loads(json.dumps(table.json(), allow_nan=False))
    assert document["psnr_db"]["mean_db"] is None
    assert document["textures"][0]["psnr_db"] is None
    assert "inf" in "\n".join(table.lines())
