"""Vector instructions of the programs of codec `block`: machine code of real compilers times the trip counts of a pack's codes.

    python -m lab.benchmarks.shaders.block_counts [PACK ...] [--json FILE] [--gpu navi32|dg2]

Loops of these programs depend on the codes that neighbouring pixels read. So framebuffer blocks of 8x8 pixels are laid at random
over the textures of a pack, turned and at a fixed lod. A subgroup runs each loop as often as its lane with the most to do.
Of branches all sides count. Nothing runs on a GPU: times are estimates.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from lab.benchmarks.measuring import report
from lab.benchmarks.shaders.compiling import GPUS, compiled, find_compiler
from lab.benchmarks.shaders.decoding_programs import gpu_of
from lab.benchmarks.shaders.machine_code import MachineCode
from lab.benchmarks.shaders.recording import AssembledProgram, ProgramRecorder
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.gpu import BlockTables
from ntc.codec.block.model import BlockDecoder, BlockTexture
from ntc.codec.block.reference import texture_codes
from ntc.codec.gpu import GPU
from ntc.codec.latents import LatentLevel, latent_levels
from ntc.codec.maps import Plane, plane_channels
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.pack.file import read_pack
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.render.resources.layout import BIN_GROUP, GROUP_SIDE, PAGE_SIDE, TILE_BORDER, TILE_SIDE
from viewer.render.resources.pack_buffers import codec_programs, scene_programs
from viewer.render.resources.visibility_buffer import PlaneReading

Array = NDArray[np.int64]
GROUPS: Final = 100
"""Framebuffer blocks, and tiles, over which trip counts are averaged."""
LODS: Final = (-2.0, 0.5, 2.5)
STOCHASTIC_LOD: Final = 0.5
FLOOR_RATE: Final = 9.3e12
"""Lane instructions that Navi32 issues in a second at most, none of them two at once."""
PIXELS: Final = {"1080p": 1920 * 1080, "4K": 3840 * 2160}
MOST_PARTS: Final = 8
"""Blocks that a trilinear footprint touches at most."""
TOGETHER: Final = GROUP_SIDE * GROUP_SIDE
NOTHING: Final = -1
"""Number of a block where a lane has none."""


class PackCodes:
    """What decides about the work of decoding a pack: the size, mode and decoder of each block's code."""

    def __init__(self, pack: Pack) -> None:
        if not isinstance(pack.config, BlockConfig) or pack.config.format < 2:
            raise InputError("trip counts are known of codec block, format 2, alone")
        self.pack, self.config = pack, pack.config
        self._tables = BlockTables(pack.config)
        self._kinds: dict[tuple[int, int], Array] = {}

    @cached_property
    def textures(self) -> tuple[BlockTexture, ...]:
        """Textures with a tile of mip 0 and more."""
        found = cast("tuple[BlockTexture, ...]", self.pack.textures)
        return tuple(own for own in found if min(own.width, own.height) >= TILE_SIDE)

    @cached_property
    def heads(self) -> NDArray[np.uint32]:
        """[decoders, sizes * modes, planes, 4]: heads of the shader's tables."""
        parts = [self._tables.head_data(cast(BlockDecoder, own)) for own in self.pack.decoders]
        return np.stack(parts).reshape(len(parts), -1, len(self.config.planes), 4)

    def levels(self, texture: BlockTexture) -> tuple[LatentLevel, ...]:
        """Levels of a texture."""
        return latent_levels(texture.width, texture.height, self.config)

    def kinds(self, texture: BlockTexture, level: int) -> Array:
        """[blocks] numbers of heads: size * modes + mode."""
        key = (id(texture), level)
        if key not in self._kinds:
            codes = texture_codes(texture, self.config, level)
            modes = (codes.codes[:, 0] & np.uint32(self.config.modes - 1)).astype(np.int64)
            self._kinds[key] = codes.sizes * self.config.modes + modes
        return self._kinds[key]


@dataclass(frozen=True)
class Part:
    """Blocks that the lanes of a framebuffer block read in one step: [64] each; NOTHING for lanes that read none."""

    level: Array
    block: Array
    mip: Array
    entries: Array
    """Words of the list of the plane, in fours."""
    edge: Array
    """1 where the code has an edge part in the plane."""


@dataclass(frozen=True)
class PixelGroup:
    """A framebuffer block over one texture, as one plane of it is decoded."""

    parts: tuple[Part, ...]
    taps: Array
    """[pixels, taps, 3] level, block and texel of the block; NOTHING where there is no tap."""
    entries_of: dict[tuple[int, int], int]
    """Fours of the list by level and block."""


def _axis(place: NDArray[np.float64], size: int) -> tuple[Array, Array]:
    """First and second texel of a bilinear lookup under `repeat`, at `place` in texels."""
    first = np.floor(place - 0.5).astype(np.int64)
    return first % size, (first + 1) % size


def pixel_group(codes: PackCodes, plane: int, lod: float, is_single: bool, random: np.random.Generator) -> PixelGroup:
    """A group at a random place and turn; with `is_single` one texel of one mip is read, as by the stochastic filter."""
    texture = codes.textures[random.integers(len(codes.textures))]
    levels = codes.levels(texture)
    turn, step = random.uniform(0.0, 2.0 * np.pi), 2.0**lod
    x, y = (own.reshape(-1) for own in np.meshgrid(np.arange(GROUP_SIDE), np.arange(GROUP_SIDE)))
    u = random.uniform(0.0, texture.width) + step * (np.cos(turn) * x - np.sin(turn) * y)
    v = random.uniform(0.0, texture.height) + step * (np.sin(turn) * x + np.cos(turn) * y)
    at = min(max(lod, 0.0), len(levels) - 1.0)
    read = sorted({int(np.floor(at)), int(np.ceil(at))})
    lanes, taps = [list[tuple[int, int]]() for _ in x], np.full((len(x), MOST_PARTS, 3), NOTHING)
    if is_single:
        chosen = np.array(read)[(random.random(len(x)) * len(read)).astype(int)]
        corner = random.integers(0, 2, (2, len(x)))
    for place, number in enumerate(read):
        level = levels[number]
        side = codes.config.code_sides[level.mip_of_cell]
        columns = _axis(u * level.texel_width / texture.width, level.texel_width)
        rows = _axis(v * level.texel_height / texture.height, level.texel_height)
        for lane in range(len(x)):
            if is_single and chosen[lane] != number:
                continue
            both = [(column[lane], row[lane]) for row in rows for column in columns]
            if is_single:
                both = both[corner[0, lane] + 2 * corner[1, lane] :][:1]
            for tap, (column, row) in enumerate(both):
                block = int(row // side * level.width + column // side)
                taps[lane, 4 * place + tap] = number, block, row % side * side + column % side
                if (number, block) not in lanes[lane]:
                    lanes[lane].append((number, block))
    heads = codes.heads[texture.group]
    found = []
    for number in range(max(map(len, lanes))):
        own = [lane[number] if number < len(lane) else (NOTHING, NOTHING) for lane in lanes]
        level_numbers, blocks = np.array(own, np.int64).T
        kinds = [codes.kinds(texture, level)[block] if level >= 0 else NOTHING for level, block in own]
        is_there = level_numbers >= 0
        head = heads[np.maximum(kinds, 0), plane].astype(np.int64)
        mips = np.array([levels[level].mip_of_cell for level in level_numbers])
        entries, edges = np.where(is_there, head[:, 1], 0), np.where(is_there, (head[:, 3] & 3) > 0, 0)
        found.append(Part(level_numbers, blocks, mips, entries, edges))
    used = {(int(level), int(block)) for level, block, _ in taps.reshape(-1, 3) if level >= 0}
    entries_of = {
        (level, block): int(heads[codes.kinds(texture, level)[block], plane, 1]) for level, block in sorted(used)
    }
    return PixelGroup(tuple(found), taps, entries_of)


def _longest(values: Array, lanes: int) -> float:
    """The most of each subgroup of `lanes` lanes, as a mean over subgroups."""
    return float(values.reshape(-1, lanes).max(axis=1).mean())


def each_part_alone(group: PixelGroup, lanes: int, shares: int) -> list[float]:
    """How often the loops of one footprint run: over a list, and over the texels of `shares` edge parts."""
    entries = sum(_longest(part.entries, lanes) for part in group.parts)
    rows = sum(_longest(part.edge << part.mip, lanes) for part in group.parts)
    texels = sum(_longest(part.edge << (2 * part.mip), lanes) for part in group.parts)
    return [entries, *[rows, texels] * shares]


def exact_trips(group: PixelGroup, lanes: int) -> list[float]:
    """How often each loop of a program that filters exactly runs: over parts, and those of a part."""
    parts = sum(_longest((part.level >= 0).astype(np.int64), lanes) for part in group.parts)
    return [parts, *each_part_alone(group, lanes, 4)]


def tile_entries(codes: PackCodes, plane: int, random: np.random.Generator) -> tuple[Array, Array]:
    """Fours of the lists of a random tile of mip 0: [blocks inside], [blocks along its border]."""
    texture = codes.textures[random.integers(len(codes.textures))]
    level, side = codes.levels(texture)[0], codes.config.block_side
    across = TILE_SIDE // side
    corner = [random.integers(0, size // TILE_SIDE) * across for size in (texture.width, texture.height)]
    kinds = codes.kinds(texture, 0).reshape(level.height, level.width)
    rows, columns = (np.arange(-1, across + 1) + corner[axis] for axis in (1, 0))
    page = codes.heads[texture.group][kinds[np.ix_(rows % level.height, columns % level.width)], plane, 1]
    page = page.astype(np.int64)
    border = np.concatenate([page[0], page[-1], page[1:-1, 0], page[1:-1, -1]])
    return page[1:-1, 1:-1].reshape(-1), border


SLOTS: Final = 32
"""Codes that a work group decodes at once (shaders/ntc/block_together.glsl)."""


def together_trips(group: PixelGroup, lanes: int, is_single: bool) -> list[float]:
    """How often each loop runs where a work group decodes the codes of its pixels together; shared memory holds all of them."""
    used = np.unique(group.taps.reshape(-1, 3), axis=0)
    used = used[used[:, 0] >= 0]
    fours = np.array([group.entries_of[int(level), int(block)] for level, block, _ in used])
    codes = {(int(own) // 2, int(block)): group.entries_of[int(own), int(block)] for own, block, _ in used}
    coefficients = -(-4 * sum(codes.values()) // TOGETHER)
    # Half of the lanes find a code each; of subgroups of 8 lanes, half do.
    finders = min(SLOTS, TOGETHER) / TOGETHER if lanes < TOGETHER else 1.0
    padded = np.zeros(-(-len(fours) // TOGETHER) * TOGETHER, np.int64)
    padded[: len(fours)] = fours
    rounds = _longest((padded > 0).astype(np.int64), lanes) * len(padded) / TOGETHER
    inner = _longest(padded, lanes) * len(padded) / TOGETHER
    mips, taps = (1, 1) if is_single else (2, 8)
    finding = finders * max(codes.values())
    edges = 0.0
    components = 4.0 * rounds
    return [
        1.0,
        mips,
        taps,
        1.5 * taps,
        finding,
        taps,
        coefficients,
        rounds,
        components,
        inner,
        edges,
        edges,
        mips,
        taps,
    ]


PAGE_TEXELS: Final = PAGE_SIDE * PAGE_SIDE


def instructions(code: MachineCode, trips: Sequence[Sequence[float]]) -> float:
    """Vector instructions of a lane: a mean over `trips`, each with the times that every loop runs."""
    return code.weighted(np.mean(np.array(trips, np.float64), axis=0).tolist())


def tile_instructions(code: MachineCode, tiles: Sequence[tuple[Array, Array]], lanes: int) -> float:
    """Vector instructions a texel of a tile that invocations decode four texels at a time, each reading all coefficients."""

    def of(entries: float) -> float:
        # First the loops for mips that are not there, last those for the texture's edges.
        return code.weighted([0.0] * 11 + [entries] + [0.0] * 12)

    inside_lanes, border_lanes = TILE_SIDE * TILE_SIDE // 4, TILE_SIDE * TILE_BORDER + 4
    found = []
    for inside, border in tiles:
        each = np.repeat(inside, inside_lanes // len(inside))
        groups = -(-border_lanes // BIN_GROUP) * BIN_GROUP
        found.append(inside_lanes * of(_longest(each, lanes)) + groups * of(float(border.max())))
    return float(np.mean(found)) / PAGE_TEXELS


@dataclass(frozen=True)
class CountedProgram:
    """A program of one plane, and what it is for."""

    path: str
    plane: Plane
    lod: float
    program: AssembledProgram


def counted_programs(context: GraphicsContext, codes: PackCodes) -> tuple[CountedProgram, ...]:
    """The programs of a GPU for each plane of a pack. Nothing is drawn."""
    recorder, found = ProgramRecorder(), list[CountedProgram]()
    planes = tuple(plane_channels(codes.config.maps, codes.config.output_channels))
    with recorder.recording():
        programs = codec_programs(scene_programs(gpu_of(context)), codes.pack, GPU)

        def made(name: str, plane: Plane, stochastic: bool) -> AssembledProgram:
            defines = {**PlaneReading(plane).defines(), "FILTER_STOCHASTIC": int(stochastic)}
            before = set(recorder.found)
            programs.compute(f"passes/{name}.comp", {**defines, "WEIGHTS_IN_IMAGE": 0, "DECODER_PLACE": 1})
            (key,) = set(recorder.found) - before
            return recorder.found[key]

        for plane in planes:
            exact = made("decode_deferred/decode", plane, False)
            found += [CountedProgram("deferred", plane, lod, exact) for lod in LODS]
            stochastic = made("decode_deferred/decode", plane, True)
            found.append(CountedProgram("deferred, stochastic", plane, STOCHASTIC_LOD, stochastic))
            found.append(
                CountedProgram("cached, a texel of a tile", plane, 0.0, made("decode_cached/decode", plane, False))
            )
    return tuple(found)


def counted(found: CountedProgram, told: dict[str, Any], codes: PackCodes, seed: int = 0) -> float:
    """Vector instructions of a program for a pixel, or for a texel of a tile."""
    random = np.random.default_rng(seed)
    code, lanes = MachineCode.parsed(told["assembly"]), min(int(told["subgroup"]), GROUP_SIDE * GROUP_SIDE)
    plane = list(plane_channels(codes.config.maps, codes.config.output_channels)).index(found.plane)
    if found.path.startswith("cached"):
        return tile_instructions(code, [tile_entries(codes, plane, random) for _ in range(GROUPS)], lanes)
    is_single = found.path.endswith("stochastic")
    groups = [pixel_group(codes, plane, found.lod, is_single, random) for _ in range(GROUPS)]
    if len(code.loops) == 14:
        return instructions(code, [together_trips(group, lanes, is_single) for group in groups])
    if is_single:
        return instructions(code, [each_part_alone(group, lanes, 1) for group in groups])
    return instructions(code, [exact_trips(group, lanes) for group in groups])


def rows(gpu: str, name: str, codes: PackCodes, context: GraphicsContext) -> Iterator[dict[str, Any]]:
    """Rows of the table: each path and lod, all planes added up. Raises InputError where a compiler is missing."""
    programs = counted_programs(context, codes)
    told = compiled(find_compiler(gpu), [own.program for own in programs])
    totals: dict[tuple[str, float], dict[Plane, float]] = {}
    for own, answer in zip(programs, told, strict=True):
        totals.setdefault((own.path, own.lod), {})[own.plane] = counted(own, answer, codes)
    for (path, lod), planes in totals.items():
        total = sum(planes.values())
        row: dict[str, Any] = {"gpu": gpu, "pack": name, "path": path, "lod": lod}
        row |= {"base": round(planes["base"]), "all planes": round(total)}
        is_frame = gpu == "navi32" and not path.startswith("cached")
        for size, pixels in PIXELS.items():
            row[f"floor ms, {size}"] = round(total * pixels / FLOOR_RATE * 1e3, 2) if is_frame else None
        yield row


def main() -> int:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("packs", nargs="+", type=Path, metavar="PACK")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--gpu", action="append", choices=tuple(GPUS), help="may be given again; default all")
    options = parser.parse_args()
    context = create_headless_context()
    try:
        found = [
            row
            for path in options.packs
            for gpu in options.gpu or GPUS
            for row in rows(gpu, path.stem, PackCodes(read_pack(path)), context)
        ]
    except InputError as error:
        print(error, file=sys.stderr)
        return 1
    report("vector instructions of codec block", found, {}, options.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
