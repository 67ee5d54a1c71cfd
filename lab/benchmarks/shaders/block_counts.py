"""Vector instructions of the programs of codec `block`: machine code of real compilers times the trip counts of a pack's codes.

    python -m lab.benchmarks.shaders.block_counts [PACK ...] [--json FILE] [--gpu navi32|dg2]

Loops of these programs depend on the codes that neighbouring pixels read. So framebuffer blocks of 8x8 pixels are laid at random
over the textures of a pack, turned and at a fixed lod. A subgroup runs each loop as often as its lane with the most to do.
Of branches all sides count, but no edge parts: few codes have one. Nothing runs on a GPU: times are estimates.
"""

import argparse
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from lab.benchmarks.shaders.compiling import GPUS, compiled, find_compiler
from lab.benchmarks.shaders.decoding_programs import gpu_of
from lab.benchmarks.shaders.machine_code import MachineCode
from lab.benchmarks.shaders.recording import AssembledProgram, ProgramRecorder
from lab.runner import report
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.gpu import BlockTables
from ntc.codec.block.model import BlockDecoder, BlockTexture
from ntc.codec.block.reference import texture_codes
from ntc.codec.gpu import GPU
from ntc.codec.latents import LatentLevel, texture_levels
from ntc.codec.maps import PLANES, Plane, plane_channels
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.pack.file import read_pack
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.locations import shaders_folder
from viewer.render.resources.layout import GROUP_SIDE, PAGE_SIDE, TILE_SIDE
from viewer.render.resources.pack_buffers import codec_programs, scene_programs
from viewer.render.resources.visibility_buffer import PlaneReading

Array = NDArray[np.int64]
GROUPS: Final = 60
"""Framebuffer blocks, and tiles, over which trip counts are averaged."""
LODS: Final = (-2.0, 0.5, 2.5)
STOCHASTIC_LOD: Final = 0.5
MOST_PARTS: Final = 8
"""Blocks that a trilinear footprint touches at most."""
TOGETHER: Final = GROUP_SIDE * GROUP_SIDE
NOTHING: Final = -1
"""Number of a block where a lane has none."""


class PackCodes:
    """Codes of a pack: size, mode and decoder of each block's code, which decide the work of decoding."""

    def __init__(self, pack: Pack) -> None:
        if not isinstance(pack.config, BlockConfig):
            raise InputError("trip counts are known of codec block alone")
        self.pack, self.config = pack, pack.config
        self._tables = BlockTables(pack.config)
        self._kinds: dict[tuple[int, int], Array] = {}

    @cached_property
    def textures(self) -> tuple[BlockTexture, ...]:
        """Textures with a tile of mip 0 and more."""
        all_textures = cast("tuple[BlockTexture, ...]", self.pack.textures)
        return tuple(texture for texture in all_textures if min(texture.width, texture.height) >= TILE_SIDE)

    @cached_property
    def work(self) -> tuple[Array, Array]:
        """Fours of the list, and fours by component, of each code: [decoders, sizes * modes, planes], the second with [4] more."""
        lists, fours = list[Array](), list[Array]()
        for decoder in self.pack.decoders:
            heads, blocks = self._tables.heads_and_lists(cast(BlockDecoder, decoder))
            words = heads.astype(np.int64)
            lists.append(words[:, 1])
            ends = blocks[words[:, 0] + words[:, 1] - len(heads), :1] >> (8 * np.arange(4)) & 127
            ends = ends.astype(np.int64)
            fours.append(np.concatenate([ends[:, :1], ends[:, 1:] - ends[:, :-1]], axis=1))
        shape = (len(lists), -1, len(self.config.planes))
        return np.stack(lists).reshape(shape), np.stack(fours).reshape(*shape, 4)

    def levels(self, texture: BlockTexture) -> tuple[LatentLevel, ...]:
        """Levels of a texture."""
        return texture_levels(texture, self.config)

    def kinds(self, texture: BlockTexture, level: int) -> Array:
        """[blocks] numbers of heads: size * modes + mode."""
        key = (id(texture), level)
        if key not in self._kinds:
            codes = texture_codes(texture, self.config, level)
            modes = (codes.codes[:, 0] & np.uint32(self.config.modes - 1)).astype(np.int64)
            self._kinds[key] = codes.sizes * self.config.modes + modes
        return self._kinds[key]


@dataclass(frozen=True)
class PixelGroup:
    """A framebuffer block over one texture, as one plane of it is decoded."""

    lists: Array
    """[parts, pixels] fours of the list of the code that a pixel reads in each step; NOTHING where it reads none."""
    fours: Array
    """[squares, 4] fours by component of the code of each square of texels that is read, those of a code one after the other."""
    coefficients: int
    """Coefficients of all codes that are read."""
    codes: int
    """Codes that are read."""
    most_fours: int
    """Fours of the largest of them."""
    most_squares: int
    """Squares that are read of one of them, at most."""

    def work_rounds(self, fours: int) -> int:
        """Return the rounds in which shared memory holds all codes, squares and coefficients, of these `fours` at once."""
        room = (self.codes, SLOTS), (len(self.fours), MOST_SQUARES), (self.coefficients, 4 * fours)
        return max(-(-asked // most) for asked, most in room)


def _axis(place: NDArray[np.float64], size: int) -> tuple[Array, Array]:
    """First and second texel of a bilinear lookup under `repeat`, at `place` in texels."""
    first = np.floor(place - 0.5).astype(np.int64)
    return first % size, (first + 1) % size


def pixel_group(codes: PackCodes, plane: int, lod: float, is_single: bool, random: np.random.Generator) -> PixelGroup:
    """A group at a random place and turn; with `is_single` one texel of one mip is read, as by the stochastic filter."""
    texture = codes.textures[random.integers(len(codes.textures))]
    levels = codes.levels(texture)
    turn, step = random.uniform(0.0, 2.0 * np.pi), 2.0**lod
    x, y = (array.reshape(-1) for array in np.meshgrid(np.arange(GROUP_SIDE), np.arange(GROUP_SIDE)))
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
                square = row % side // 2 * (side // 2) + column % side // 2
                taps[lane, 4 * place + tap] = number, block, square
                if (number, block) not in lanes[lane]:
                    lanes[lane].append((number, block))
    lists, fours = (array[texture.group, :, plane] for array in codes.work)
    most = max(map(len, lanes))
    steps = np.full((most, len(lanes)), NOTHING)
    for lane, read_codes in enumerate(lanes):
        steps[: len(read_codes), lane] = [lists[codes.kinds(texture, level)[block]] for level, block in read_codes]
    used = np.unique(taps[taps[..., 0] >= 0], axis=0)
    kinds = np.array([codes.kinds(texture, level)[block] for level, block, _ in used])
    # Mips of the same code are decoded together.
    stored_levels = [levels[level].first_cell for level, _, _ in used]
    _, first, squares = np.unique(
        np.stack([stored_levels, used[:, 1]], axis=-1), axis=0, return_index=True, return_counts=True
    )
    coefficients = 4 * int(fours[kinds[first]].sum())
    return PixelGroup(
        steps,
        fours[kinds],
        coefficients,
        len(first),
        int(fours[kinds].sum(axis=1).max()),
        int(squares.max()),
    )


def _longest(values: Array, lanes: int) -> float:
    """Return the maximum of each subgroup of `lanes` lanes, as a mean over subgroups."""
    return float(values.reshape(-1, lanes).max(axis=1).mean())


def alone_trips(group: PixelGroup, lanes: int, is_single: bool) -> list[float]:
    """Return trip counts of the loops where each pixel decodes alone: over parts of its footprint, and over the list of each part."""
    parts = sum(_longest((codes >= 0).astype(np.int64), lanes) for codes in group.lists)
    lists = sum(_longest(np.maximum(codes, 0), lanes) for codes in group.lists)
    return [lists] if is_single else [parts, lists]


def _in_rounds(fours: Array, lanes: int) -> NDArray[np.float64]:
    """Rounds of a work group over texels with `fours` [texels, 4]: rounds, fours of first components, further components, and fours
    in them, as means over its subgroups."""
    present = np.argsort(fours == 0, axis=1, kind="stable")
    fours = np.take_along_axis(fours, present, axis=1)
    padded = np.pad(fours, ((0, -len(fours) % TOGETHER), (0, 0)), constant_values=NOTHING)
    subgroups = padded.reshape(-1, lanes, 4).max(axis=1)
    first, others = np.maximum(subgroups[:, 0], 0), np.maximum(subgroups[:, 1:], 0)
    counts = (subgroups[:, 0] >= 0).sum(), first.sum(), (others > 0).sum(), others.sum()
    return np.array(counts) * (lanes / TOGETHER)


def together_trips(group: PixelGroup, lanes: int, is_single: bool) -> list[float]:
    """Return trip counts of the loops where a work group decodes the codes of its pixels together."""
    return trips_of_rounds(group, lanes, is_single, group.work_rounds(PLANE_FOURS))


def trips_of_rounds(group: PixelGroup, lanes: int, is_single: bool, again: int, are_known: bool = False) -> list[float]:
    """Return the trip counts of `together_trips` in `again` rounds; `are_known` is true where the group knows its codes already."""
    mips, taps = (1, 1) if is_single else (2, 8)
    # A lane finds a code; half of the lanes do. Most places in the hash table are free at once.
    finding = group.most_fours * (1.0 if lanes == TOGETHER else 0.5)
    coefficients = -(-group.coefficients // (4 * TOGETHER))
    # Where a pixel reads one texel, it lists its square itself.
    listing = [] if is_single else [group.most_squares]
    finding_trips = np.array([mips, taps, PROBES * taps]) * (again - are_known)
    listed = np.array(listing) * (again - are_known)
    decoding = [coefficients, *_in_rounds(group.fours, lanes), mips * again, taps * again]
    return [again, *finding_trips.tolist(), finding * again, *listed.tolist(), *decoding]


def joint_trips(groups: Sequence[PixelGroup], lanes: int, is_single: bool) -> list[float]:
    """Return trip counts of the loops where a work group decodes planes in turn; `groups` has one group per plane, of equal texels."""
    total, are_known = np.zeros(0), False
    for group in groups:
        rounds = group.work_rounds(PLANES_FOURS)
        trips = np.array(trips_of_rounds(group, lanes, is_single, rounds, are_known))
        total = total + trips if len(total) else trips
        # After several rounds, shared memory has only the codes of the last round: the next plane needs all of them.
        are_known = rounds == 1
    return [1.0, float(len(groups)), *total.tolist()]


@dataclass(frozen=True)
class Tile:
    """A tile of mip 0 of one plane of a texture."""

    page: Array
    """[rows, columns] kinds of codes, those of the border on the right and below with them."""
    lists: Array
    fours: Array
    """[kinds, 4] fours by component; of `lists` [kinds] in the order of the list."""

    @property
    def squares(self) -> int:
        """Squares of 2x2 texels of a code."""
        return (TILE_SIDE // (len(self.page) - 1)) ** 2 // 4

    @property
    def strips(self) -> int:
        """Squares of a code along the border."""
        return TILE_SIDE // (len(self.page) - 1) // 2


def random_tile(codes: PackCodes, plane: int, random: np.random.Generator) -> Tile:
    """A tile at a random place, under `repeat`."""
    texture = codes.textures[random.integers(len(codes.textures))]
    level, across = codes.levels(texture)[0], TILE_SIDE // codes.config.block_side
    corner = [random.integers(0, size // TILE_SIDE) * across for size in (texture.width, texture.height)]
    kinds = codes.kinds(texture, 0).reshape(level.height, level.width)
    rows, columns = (np.arange(across + 1) + corner[axis] for axis in (1, 0))
    page = kinds[np.ix_(rows % level.height, columns % level.width)]
    lists, fours = (array[texture.group, :, plane] for array in codes.work)
    return Tile(page, lists, fours)


def _units(page: Array, inside: int, border: int) -> Array:
    """[codes] how often each code of a page is decoded: inside, along the border, and once in the corner."""
    units = np.full(page.shape, inside)
    units[-1] = units[:, -1] = border
    units[-1, -1] = 1
    return units.reshape(-1)


def tile_alone(code: MachineCode, tile: Tile, lanes: int) -> float:
    """Return vector instructions per texel where each invocation decodes a square of texels and reads all its coefficients."""
    units = _units(tile.page, tile.squares, tile.strips)
    kinds, inside = tile.page.reshape(-1), units == tile.squares
    squares = np.concatenate([np.repeat(kinds[squares_of], units[squares_of]) for squares_of in (inside, ~inside)])
    longest = np.pad(tile.lists[squares], (0, -len(squares) % lanes)).reshape(-1, lanes).max(axis=1)
    each = [code.weighted([1.0, most, 4.0]) for most in longest]
    return float(np.sum(each)) * lanes / PAGE_TEXELS


def _code_rounds(fours: Array) -> list[NDArray[np.bool_]]:
    """Return the masks [codes] of the codes, with `fours` [codes], that a work group holds in each round."""
    rounds, left = list[NDArray[np.bool_]](), np.full(len(fours), True)
    while left.any():
        fits = left & (np.cumsum(np.where(left, fours, 0)) <= TILE_FOURS)
        rounds.append(fits)
        left &= ~fits
    return rounds


def tile_together(code: MachineCode, tile: Tile, lanes: int) -> float:
    """Return vector instructions per texel where a work group decodes a tile, TILE_SLOTS codes at once."""
    fours = tile.fours[tile.page.reshape(-1)]
    lengths, units = fours.sum(axis=1), _units(tile.page, tile.squares // 2, 1)
    # Subgroups that find codes, of those of the work group.
    share = 1.0 if lanes == TOGETHER else TILE_SLOTS / TOGETHER
    trips = np.zeros(9)
    for first in range(0, len(fours), TILE_SLOTS):
        page = np.arange(first, min(first + TILE_SLOTS, len(fours)))
        trips[0] += 1
        for fits in _code_rounds(lengths[page]):
            held = page[fits]
            # The longest first.
            held = held[np.argsort(-np.minimum(lengths[held], LENGTHS - 1), kind="stable")]
            finding, writing = share * lengths[held].max(), share * units[held].max()
            decoding = _in_rounds(np.zeros((int(lengths[held].sum()), 4), np.int64), lanes)[0]
            trips[1:5] += 1, finding, decoding, writing
            trips[5:9] += _in_rounds(np.repeat(fours[held], units[held], axis=0), lanes)
    return code.weighted(trips.tolist()) * TOGETHER / PAGE_TEXELS


def shader_number(file: str, name: str) -> int:
    """Return the whole number that a file below shaders/ gives `name`, as a `#define` or a `const int`.

    Raises ValueError where the file gives none, or several."""
    text = (shaders_folder() / file).read_text(encoding="utf-8")
    numbers = re.findall(rf"^(?:#define {name} |const int {name} = )(\d+);?$", text, re.MULTILINE)
    if len(numbers) != 1:
        raise ValueError(f"shaders/{file} defines {name} {len(numbers)} times as a number")
    return int(numbers[0])


PIXEL_SHADER: Final = "ntc/block_pixels.glsl"
TILE_SHADER: Final = "passes/decode_cached/decode_together.comp"
SLOTS: Final = 1 << shader_number(PIXEL_SHADER, "SLOT_BITS")
"""Codes that a work group holds at once."""
MOST_SQUARES: Final = shader_number(PIXEL_SHADER, "MOST_SQUARES")
"""Squares of texels likewise."""
PLANE_FOURS: Final = shader_number(PIXEL_SHADER, "PLANE_FOURS")
"""Coefficients likewise, in fours, if no code has more."""
PLANES_FOURS: Final = shader_number(PIXEL_SHADER, "PLANES_FOURS")
"""The same where a pass decodes several planes."""
TILE_SLOTS: Final = shader_number(TILE_SHADER, "SLOTS")
"""Codes that a work group holds of a tile."""
TILE_FOURS: Final = shader_number(TILE_SHADER, "USUAL_FOURS")
"""Fours of their coefficients."""
LENGTHS: Final = shader_number(TILE_SHADER, "LENGTHS")
"""Number of classes by fours into which it sorts codes."""
PROBES: Final = 1.5
"""Places of the hash table that a subgroup looks at for a code, estimated."""
PAGE_TEXELS: Final = PAGE_SIDE * PAGE_SIDE
EDGE_PART: Final = ("uint width = code.head.w & 3u;", "uint width = 0u;")
"""What decides whether a code has an edge part, and what says that none has. Edge parts are few: they are counted without."""
CODED: Final = ("if (textures[tile.texture_id].srgb == 0)", "if (false)")
"""What decides whether a tile's base colours have to be coded for sRGB. Packs hold them so: that is not counted either."""


def instructions(code: MachineCode, trips: Sequence[Sequence[float]]) -> float:
    """Return vector instructions of a lane, a mean over `trips`: trip counts of every loop."""
    return code.weighted(np.mean(np.array(trips, np.float64), axis=0).tolist())


@dataclass(frozen=True)
class CountedProgram:
    """Program to count, with its path, plane and level of detail."""

    path: str
    plane: Plane | None
    """Plane that it decodes; None: all that views show."""
    lod: float
    together: int
    """As in DecoderVariant."""
    program: AssembledProgram


def pack_planes(codes: PackCodes) -> list[Plane]:
    """Planes that a pack has."""
    return list(plane_channels(codes.config.maps, codes.config.output_channels))


def shown_planes(codes: PackCodes) -> list[Plane]:
    """Planes of a pack that views show."""
    return [plane for plane in pack_planes(codes) if plane in PLANES]


def counted_programs(context: GraphicsContext, codes: PackCodes, together: int) -> tuple[CountedProgram, ...]:
    """Return the programs of a GPU for each plane of a pack. Nothing is drawn."""
    recorder, programs_to_count = ProgramRecorder(), list[CountedProgram]()
    with recorder.recording():
        programs = codec_programs(scene_programs(gpu_of(context)), codes.pack, replace(GPU, together=together))

        def made(name: str, plane: Plane | None, stochastic: bool) -> AssembledProgram:
            reading = PlaneReading(plane or "base", has_several=plane is None)
            defines = {**reading.defines(), "FILTER_STOCHASTIC": int(stochastic)}
            before = set(recorder.programs)
            programs.compute(
                f"passes/{name}.comp", {**defines, "WEIGHTS_IN_IMAGE": 0, "DECODER_PLACE": 1, "BY_SQUARES": 1}
            )
            (key,) = set(recorder.programs) - before
            program = recorder.programs[key]
            return replace(program, texts=tuple(text.replace(*EDGE_PART).replace(*CODED) for text in program.texts))

        for plane in pack_planes(codes):
            exact = made("decode_deferred/decode", plane, False)
            programs_to_count += [CountedProgram("deferred", plane, lod, together, exact) for lod in LODS]
            stochastic = made("decode_deferred/decode", plane, True)
            programs_to_count.append(
                CountedProgram("deferred, stochastic", plane, STOCHASTIC_LOD, together, stochastic)
            )
            tile = made(f"decode_cached/decode{'_together' if together else ''}", plane, False)
            programs_to_count.append(CountedProgram("cached, a texel of a tile", plane, 0.0, together, tile))
        if together and len(shown_planes(codes)) > 1:
            exact = made("decode_deferred/decode_planes", None, False)
            programs_to_count += [CountedProgram("deferred", None, lod, together, exact) for lod in LODS]
            stochastic = made("decode_deferred/decode_planes", None, True)
            programs_to_count.append(CountedProgram("deferred, stochastic", None, STOCHASTIC_LOD, together, stochastic))
    return tuple(programs_to_count)


def counted(program: CountedProgram, machine: dict[str, Any], codes: PackCodes, seed: int = 0) -> float:
    """Return vector instructions of a program per pixel, or per texel of a tile."""
    code, lanes = MachineCode.parsed(machine["assembly"]), min(int(machine["subgroup"]), TOGETHER)
    is_single = program.path.endswith("stochastic")

    def groups(plane: Plane) -> list[PixelGroup]:
        random, number = np.random.default_rng(seed), pack_planes(codes).index(plane)
        return [pixel_group(codes, number, program.lod, is_single, random) for _ in range(GROUPS)]

    if program.plane is None:
        of_planes = [groups(plane) for plane in shown_planes(codes)]
        return instructions(
            code, [joint_trips(plane_groups, lanes, is_single) for plane_groups in zip(*of_planes, strict=True)]
        )
    if program.path.startswith("cached"):

        def of_tile(tile: Tile) -> float:
            return tile_together(code, tile, lanes) if program.together else tile_alone(code, tile, lanes)

        random, number = np.random.default_rng(seed), pack_planes(codes).index(program.plane)
        return float(np.mean([of_tile(random_tile(codes, number, random)) for _ in range(GROUPS)]))
    trips = together_trips if program.together else alone_trips
    return instructions(code, [trips(group, lanes, is_single) for group in groups(program.plane)])


def rows(
    gpu: str, name: str, codes: PackCodes, context: GraphicsContext, together: int = 1
) -> Iterator[dict[str, Any]]:
    """Yield the rows of the table, by path and lod. All planes are counted in one pass where there is one, else added up.

    Raises InputError where a compiler is missing.
    """
    programs = counted_programs(context, codes, together)
    distinct = list(dict.fromkeys(counted_program.program.texts for counted_program in programs))
    first = [
        next(counted_program.program for counted_program in programs if counted_program.program.texts == texts)
        for texts in distinct
    ]
    machine_of = dict(zip(distinct, compiled(find_compiler(gpu), first), strict=True))
    totals: dict[tuple[str, float], dict[Plane | None, float]] = {}
    for counted_program in programs:
        totals.setdefault((counted_program.path, counted_program.lod), {})[counted_program.plane] = counted(
            counted_program, machine_of[counted_program.program.texts], codes
        )
    for (path, lod), planes in totals.items():
        total = planes[None] if None in planes else sum(planes.values())
        row: dict[str, Any] = {"gpu": gpu, "pack": name, "together": together, "path": path, "lod": lod}
        row["planes"] = len(codes.config.planes)
        row |= {"base": round(planes["base"]), "all planes": round(total)}
        yield row


def main() -> int:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("packs", nargs="+", type=Path, metavar="PACK")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--gpu", action="append", choices=tuple(GPUS), help="may be given again; default all")
    parser.add_argument("--together", action="append", type=int, choices=(0, 1), help="1: by work groups; default both")
    options = parser.parse_args()
    context = create_headless_context()
    try:
        all_rows = [
            row
            for path in options.packs
            for gpu in options.gpu or GPUS
            for together in options.together or (0, 1)
            for row in rows(gpu, path.stem, PackCodes(read_pack(path)), context, together)
        ]
    except InputError as error:
        print(error, file=sys.stderr)
        return 1
    report("vector instructions of codec block", all_rows, {}, options.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
