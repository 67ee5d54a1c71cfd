"""Registers, spills, instructions and occupancy of every decode program on GPUs of AMD and Intel, compiled without them.

    python -m lab.benchmarks.shaders.statistics [--json FILE] [--gpu navi32|dg2] [--codec NAME]

Needs glslang and the Vulkan drivers of Mesa 23.2 or newer; for Intel a C compiler, too.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from math import gcd
from pathlib import Path
from typing import Any, Final

from lab.benchmarks.shaders.compiling import GPUS, compiled, find_compiler
from lab.benchmarks.shaders.decoding_programs import CODECS, DecodingProgram, decoding_programs
from lab.benchmarks.shaders.machine_code import MachineCode
from lab.runner import report
from ntc.codec.gpu import GPU, DecoderVariant
from ntc.codec.grid.model import GridConfig
from ntc.errors import InputError
from viewer.gl.context import create_headless_context

SEVERAL: Final = ("deferred, shared", "binned", "cached")
"""Paths whose invocations decode as many pixels as `DecoderVariant` says."""


def network_loops(program: DecodingProgram, variant: DecoderVariant) -> tuple[tuple[int, ...], int]:
    """Return (trip counts of the loops over both hidden layers, pixels of one invocation); codec `block` has no such loops."""
    config = program.config
    if not isinstance(config, GridConfig):
        return (), 1
    blocks = config.hidden_width // 4
    if program.path not in SEVERAL:
        return (blocks, blocks), 1
    return (blocks // gcd(blocks, variant.unrolled), blocks), variant.pixels


FIGURES: Final = ("registers", "scratch bytes", "waves", "lanes", "instructions")
AMD: Final = ("VGPRs", "Scratch size", "Subgroups per SIMD", "subgroup", "Instructions")
"""Names of FIGURES in RADV."""
INTEL: Final = ("Max live registers", "Scratch Memory Size", "", "subgroup", "Instruction Count")
"""Names of FIGURES in ANV. It has no number of waves, because a thread always has all its registers."""

SPILLS: Final = ("Spilled VGPRs", "Spilled SGPRs", "Spill Count")
"""Names of the numbers of spilled registers in both drivers."""


def row(program: DecodingProgram, answer: Mapping[str, Any], variant: DecoderVariant) -> dict[str, Any]:
    """Return the figures of a program; None where the compiler failed.

    Vector instructions per texel are None for codec `block`, whose loops depend on the data.
    """
    loops, pixels = network_loops(program, variant)
    names = AMD if "VGPRs" in answer else INTEL
    figures = {figure: answer.get(name) for figure, name in zip(FIGURES, names, strict=True)}
    # ANV's code for arithmetic in halves has more loops than the layers, and they cannot be distinguished.
    counted = bool(loops) and "assembly" in answer and ("VGPRs" in answer or program.precision in ("fp32", "fp16"))
    code = MachineCode.parsed(answer.get("assembly", ""))
    return {
        "path": program.path,
        "codec": program.codec,
        "precision": program.precision,
        "spills": sum(int(answer[name]) for name in SPILLS if name in answer) if answer else None,
        **figures,
        "vector instructions a texel": round(code.vector_instructions(loops, pixels)) if counted else None,
    }


def statistics(gpu: str, programs: Sequence[DecodingProgram], variant: DecoderVariant = GPU) -> list[dict[str, Any]]:
    """Return a row for each program on a GPU of GPUS. Raises InputError where a compiler is missing."""
    answers = compiled(find_compiler(gpu), [program.program for program in programs])
    return [{"gpu": gpu, **row(program, answer, variant)} for program, answer in zip(programs, answers, strict=True)]


def main() -> int:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    parser.add_argument("--codec", action="append", choices=tuple(CODECS), help="may be given again; default all")
    parser.add_argument("--gpu", action="append", choices=tuple(GPUS), help="may be given again; default all")
    options = parser.parse_args()
    programs = decoding_programs(create_headless_context(), tuple(options.codec or CODECS))
    try:
        rows = [row_of for gpu in options.gpu or GPUS for row_of in statistics(gpu, programs)]
    except InputError as error:
        print(error, file=sys.stderr)
        return 1
    report("decode programs", rows, {}, options.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
