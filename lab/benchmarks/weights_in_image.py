"""Speed-up on a software renderer by weights in an image, and by decoding several pixels with one decoder.

    python -m lab.benchmarks.weights_in_image [--json FILE]

512x512 pixels, every decoder in every block, codec of recipe best, fp32; all ways in one run, taking turns.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from lab.bench.fixture import DecodeFixture, PackLoader, interleaved_words
from lab.bench.interleaved import time_interleaved
from lab.bench.random_pack import square_pack
from lab.bench.tiles import Tiling
from lab.benchmarks.measuring import report
from ntc.codec.gpu import SOFTWARE
from ntc.codec.grid.training.config import recipe_codec
from viewer.gl.context import create_headless_context
from viewer.render.passes.decode import DecodeBinnedPass, DecodeDeferredPass
from viewer.render.resources.pack_buffers import DecoderRanges, PackBuffers, codec_programs
from viewer.render.resources.visibility_buffer import PlaneReading

SIZE = (512, 512)
TEXTURES = 64


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    context = create_headless_context()
    loader = PackLoader(context)
    fixture = DecodeFixture(context, Tiling(SIZE, 1), interleaved_words(SIZE, TEXTURES))
    inputs = fixture.inputs(loader.materials, TEXTURES)
    names: list[tuple[str, str, int]] = []
    runs: list[Callable[[], None]] = []
    for decoders in (1, 5, 10, 20):
        pack = square_pack(TEXTURES, decoders, 256, recipe_codec("best", 3, None))
        for place, variant in (("buffer", replace(SOFTWARE, weights="uniforms")), ("image", SOFTWARE)):
            programs = codec_programs(loader.programs, pack, variant)
            buffers = PackBuffers(context, pack, range(TEXTURES), "fp32", variant=variant)
            ranges = DecoderRanges(context, pack, "fp32", variant)
            indexed = DecodeDeferredPass(context, programs, buffers, ranges, PlaneReading(), None)
            names.append(("deferred, index by pixel", place, decoders))
            runs.append(lambda run=indexed: run.run(inputs, fixture.target))  # type: ignore[misc]
            if decoders == 1:
                shared = DecodeDeferredPass(context, programs, buffers, ranges, PlaneReading(), 0)
                names.append(("deferred, shared", place, decoders))
                runs.append(lambda run=shared: run.run(inputs, fixture.target))  # type: ignore[misc]
            binned = DecodeBinnedPass(context, programs, buffers, ranges, PlaneReading())
            names.append(("binned", place, decoders))
            runs.append(lambda run=binned: run.run(inputs, fixture.target))  # type: ignore[misc]
    spreads = time_interleaved(context, runs, options.repeats)
    shared_ms = spreads[names.index(("deferred, shared", "image", 1))].median_ms
    rows = [
        {"path": path, "weights in": place, "decoders": decoders, "ms": spread.median_ms, "min ms": spread.min_ms}
        | {"times shared": spread.median_ms / shared_ms}
        for (path, place, decoders), spread in zip(names, spreads, strict=True)
    ]
    report("weights in an image", rows, {"renderer": context.info.renderer, "repeats": options.repeats}, options.json)


if __name__ == "__main__":
    main()
