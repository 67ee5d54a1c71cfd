"""Tables of decoders of codec `block` on GPUs, as shaders/ntc/block.glsl reads them: blocks of four 32-bit words, for each decoder

- heads: a block for each size of a code, mode and plane: where its list begins (in blocks from the decoder's first), how many
  blocks the list has, the bit of a code that holds the first branch of the plane in its lower half and the bit of the plane's edge
  part in its upper half, and the edge part's bits a texel with the word of the plane's first row above 2 bits;
- lists: a word for each coefficient that has bits, four to a block: from the lowest bit, the bit of a code at which its other bits
  begin (10 bits), its depth (3), component (2), row of the plane (8), and scale in steps of 1/16 octave (9). After each list, its
  order by component, in which work groups keep it: a word with a byte for each component, where its coefficients end, counted in
  fours, and the highest bit set where it has any (of the first one always, where no component has); then a word for each four of the
  list with the places of its coefficients, and with those of empty ones that fill up fours. The first block of all lists is empty;
- rows: words for each row of the basis. Of mip 0 of a code a word for each texel: signed bytes of the texel, its neighbours on the
  right, below, and on the right below. Of each coarser mip two words for each texel: the same as signed halves of a word, of sums
  over texels. Then, from a whole block on, what work groups read: two words for each square of 2x2 texels of every mip: its texels,
  averaged in coarser mips, as floats of 16 bits, which hold them exactly. Of a mip of one texel that is the sum of the first two.
  Then, of each mip of four texels a side and more, the texels of the first column, and those of the first row, two in a word.
"""

from collections.abc import Mapping
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.codes import bit_places, edge_places
from ntc.codec.block.config import COLOUR_BITS, LARGEST_SIZES, BlockConfig
from ntc.codec.block.model import BlockDecoder, BlockTexture
from ntc.codec.block.storage import DIRECTORY_RUN, level_rows
from ntc.codec.block.trellis import (
    DEEP_CURVE,
    DEEP_DEPTH,
    LEVEL_STEPS,
    SCALE_ORIGIN,
    SCALE_STEPS_PER_OCTAVE,
    SHALLOW_CURVE,
    branch_tables,
)
from ntc.codec.gpu import GpuTables, StoredRows, TextureFields, defines_by_plane
from ntc.codec.latents import texture_levels
from ntc.codec.maps import Plane, plane_channels
from ntc.codec.mips import srgb_channels
from ntc.codec.model import Decoder, EncodedTexture

Words = NDArray[np.uint32]
AT_ONCE = 4
"""Coefficients that shaders read at once."""
MOST_COMPONENTS = 4
"""Components of a plane at most."""
STRIP_WORDS = 4
"""Words of a column or row of texels that work groups decode at once."""
MOST_TOGETHER = 256
"""Most coefficients of a code that a work group decodes: an order has a byte for each place."""
PLACE_MASK = 1023
"""Bits of an entry that name a place in a code."""
STEPS_ORIGIN = 2 * SCALE_ORIGIN - min(LEVEL_STEPS)
"""Stored scale of an entry whose scale is 1."""


def trellis_subsets() -> int:
    """Subset by the four bits that end with a branch bit, the first of them lowest: two bits each."""
    _, subsets = branch_tables()
    packed = 0
    for window in range(16):
        state = (window & 1) << 2 | (window & 2) | (window >> 2 & 1)
        packed |= int(subsets[state, window >> 3]) << (2 * window)
    return packed


def _lists(entries: NDArray[np.int64], is_used: NDArray[np.bool_], components: NDArray[np.int64]) -> tuple[Words, ...]:
    """Lists of modes with their orders, of a word for each coefficient [modes, coefficients] and its component [coefficients].

    ([blocks, 4], [modes] first block of each list, [modes] blocks of it without its order).
    """
    of_component = is_used[:, None] & (components == np.arange(MOST_COMPONENTS)[:, None])
    used, counts = is_used.sum(axis=1), of_component.sum(axis=2)
    words = -(-counts // AT_ONCE)
    ends = words.cumsum(axis=1)
    blocks = -(-used // AT_ONCE)
    order_blocks = -(-(1 + ends[:, -1]) // AT_ONCE)
    last = (blocks + order_blocks).cumsum()
    first = last - blocks - order_blocks
    words_of_lists = np.zeros(AT_ONCE * int(last[-1]), np.int64)
    # Where a coefficient lies in its list, and by component.
    mode, coefficient = np.nonzero(is_used)
    place = (is_used.cumsum(axis=1) - 1)[mode, coefficient]
    component = components[coefficient]
    rank = (of_component.cumsum(axis=2) - 1)[mode, component, coefficient]
    ordered = AT_ONCE * (ends[mode, component] - words[mode, component]) + rank
    words_of_lists[AT_ONCE * first[mode] + place] = entries[mode, coefficient]
    words_before = ends[:, -1].cumsum() - ends[:, -1]
    begins = np.repeat(AT_ONCE * words_before, AT_ONCE * ends[:, -1])
    places, is_left, is_free = np.zeros(len(begins), np.int64), np.full(len(begins), True), np.full(len(begins), True)
    places[AT_ONCE * words_before[mode] + place] = ordered
    # Empty ones take the places that are left over.
    is_left[AT_ONCE * words_before[mode] + place] = False
    is_free[AT_ONCE * words_before[mode] + ordered] = False
    places[is_left] = np.nonzero(is_free)[0] - begins[is_left]
    shifts, order = 8 * np.arange(AT_ONCE), AT_ONCE * (first + blocks)
    is_read = counts > 0
    is_read[:, 0] |= ~is_read.any(axis=1)
    words_of_lists[order] = ((ends | is_read << 7) << shifts).sum(axis=1)
    within = np.arange(len(places) // AT_ONCE) - np.repeat(words_before, ends[:, -1])
    words_of_lists[np.repeat(order + 1, ends[:, -1]) + within] = (places.reshape(-1, AT_ONCE) << shifts).sum(axis=1)
    return words_of_lists.astype(np.uint32).reshape(-1, AT_ONCE), first.astype(np.uint32), blocks.astype(np.uint32)


def _squares(side: int) -> int:
    """Return the squares of 2x2 texels of a mip of `side` texels; one where it is a texel."""
    return max(side // 2, 1) ** 2


def _square_words(texels: NDArray[np.float64]) -> Words:
    """Rows `texels` [coefficients, side, side] of a mip: [coefficients, words], two words for each square."""
    side = texels.shape[1]
    if side == 1:
        # Of more than 11 bits: what the first float leaves is in the second.
        high = texels.astype(np.float16)
        four = np.concatenate([high, texels - high, np.zeros((len(texels), 1, 2))], axis=2)
    else:
        four = texels.reshape(-1, side // 2, 2, side // 2, 2).transpose(0, 1, 3, 2, 4)
    return _half_words(four)


def _half_words(texels: NDArray[np.float64]) -> Words:
    """Return `texels` [coefficients, ...] as floats of 16 bits, two in a word: [coefficients, words]."""
    return np.ascontiguousarray(texels, "<f2").reshape(len(texels), -1).view("<u4")


class BlockTables(GpuTables):
    """Codes as files hold them, in rows of one word; tables of the transform, the same for every precision."""

    number_type = "u4"
    decodes_quads = True
    shader = "ntc/block.glsl"

    def __init__(self, settings: BlockConfig) -> None:
        super().__init__(settings)
        self._config = settings
        config = settings
        self.heads = len(config.block_words) * config.modes * len(config.planes)
        # A list holds the coefficients of one plane that have bits; each list ends with a whole block.
        most = [min(config.coefficients, 32 * words) for words in config.block_words]
        lists, planes = sum(each // AT_ONCE for each in most), len(most) * len(config.planes)
        # A word of an order has four places; there are the ends, and up to four words that are not full.
        orders = sum(each // AT_ONCE**2 for each in most) + 3 * planes
        self.lists = 1 + (lists + 2 * planes + orders) * config.modes
        self.most_coefficients = max(most) + AT_ONCE * MOST_COMPONENTS
        self.together_shader = "ntc/block_pixels.glsl" if self.most_coefficients <= MOST_TOGETHER else ""
        self.row_blocks = sum(self._row_words) // AT_ONCE
        self.decoder_blocks = self.heads + self.lists + config.coefficients * self.row_blocks

    @property
    def _row_words(self) -> tuple[int, ...]:
        """Words of a row by mip of a code, padded to whole blocks; of squares of all mips; of strips, padded to whole blocks."""
        sides = self._config.code_sides
        mips = [side * side * (1 if mip == 0 else 2) for mip, side in enumerate(sides)]
        mips[-1] += -sum(mips) % AT_ONCE
        squares = 2 * sum(_squares(side) for side in sides)
        strips = sum(2 * STRIP_WORDS for side in sides if side >= AT_ONCE)
        return (*mips, squares, strips + -(squares + strips) % AT_ONCE)

    def _rows(self, decoder: BlockDecoder) -> Words:
        """[coefficients, words of a row]."""
        config, parts, squares, strips = self._config, list[Words](), list[Words](), list[Words]()
        for mip, side in enumerate(config.code_sides):
            count = 1 << mip
            sums = decoder.basis.astype(np.int64).reshape(-1, side, count, side, count).sum(axis=(2, 4))
            squares.append(_square_words(sums / count**2))
            if side >= AT_ONCE:
                both = np.zeros((len(sums), 2, 2 * STRIP_WORDS))
                both[..., :side] = np.stack([sums[:, :, 0], sums[:, 0]], axis=1) / count**2
                strips.append(_half_words(both))
            padded = np.pad(sums, ((0, 0), (0, 1), (0, 1)))
            right, down = padded[:, :side, 1:], padded[:, 1:, :side]
            four = [sums, right, down, padded[:, 1:, 1:]]
            if mip == 0:
                words = sum((part & 255) << (8 * place) for place, part in enumerate(four))
            else:
                low, high = ((four[n] & 65535) | (four[n + 1] & 65535) << 16 for n in (0, 2))
                words = np.stack([low, high], axis=-1)
            parts.append(np.asarray(words).reshape(len(sums), -1))
        each = (
            *parts,
            np.concatenate(squares, axis=1),
            np.concatenate([*strips, np.zeros((len(decoder.basis), 0))], axis=1),
        )
        filled = [
            np.pad(words, ((0, 0), (0, count - words.shape[1])))
            for words, count in zip(each, self._row_words, strict=True)
        ]
        return np.concatenate(filled, axis=1).astype(np.uint32)

    def heads_and_lists(self, decoder: BlockDecoder) -> tuple[Words, Words]:
        """Return the heads of [sizes of codes * modes, planes], and the lists with their orders: [blocks, 4] each."""
        config = self._config
        sizes, modes = np.divmod(np.arange(len(config.block_words) * config.modes), config.modes)
        places = bit_places(modes, sizes, decoder, config)
        edges = decoder.fitting_edges(config)[sizes, modes].astype(np.int64)
        component, plane = self._places_of_channels()
        planes = plane[decoder.channels]
        heads = np.zeros((len(modes), len(config.planes), 4), np.uint32)
        lists: list[Words] = []
        first = self.heads + 1
        steps = decoder.basis_scale.astype(np.int64) - min(LEVEL_STEPS)
        for number in range(len(config.planes)):
            edge_at = edge_places(decoder, config, number)[sizes, modes]
            first_row = int((planes < number).sum())
            row_word = AT_ONCE * (self.heads + self.lists + first_row * self.row_blocks)
            rows = np.nonzero(planes == number)[0]
            depths = places.depths[:, rows].astype(np.int64)
            is_used = depths > 0
            components = component[decoder.channels[rows]]
            # Where no bits follow, the place says nothing; it may lie behind the last bit.
            entries = np.minimum(places.others[:, rows], PLACE_MASK) | depths << 10
            entries |= components << 13 | (rows - first_row) << 15
            entries |= (decoder.scales[modes[:, None], rows] + steps[rows] + np.array(LEVEL_STEPS)[depths]) << 23
            plane_lists, begins, blocks = _lists(entries, is_used, components)
            # A mode without coefficients has no branch.
            is_first = is_used & (is_used.cumsum(axis=1) == 1)
            branches = (places.branches[:, rows] * is_first).sum(axis=1)
            heads[:, number, 0] = first + begins
            heads[:, number, 1] = blocks
            heads[:, number, 2] = branches | edge_at << 16
            heads[:, number, 3] = edges[:, number] | row_word << 2
            lists.append(plane_lists)
            first += len(plane_lists)
        return heads.reshape(-1, 4), np.concatenate([np.zeros((1, 4), np.uint32), *lists])

    def _places_of_channels(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """([channels] component, [channels] number of the plane)."""
        component = np.zeros(self._config.output_channels, np.int64)
        plane = np.zeros(self._config.output_channels, np.int64)
        for number, channels in enumerate(self._planes.values()):
            for place, channel in channels.items():
                component[channel], plane[channel] = place, number
        return component, plane

    def decoder_data(self, decoder: Decoder) -> bytes:
        block_decoder = cast(BlockDecoder, decoder)
        heads, lists = self.heads_and_lists(block_decoder)
        filled = np.pad(lists, ((0, self.lists - len(lists)), (0, 0)))
        rows = self._rows(block_decoder).reshape(-1, AT_ONCE)
        return np.concatenate([heads, filled, rows]).astype("<u4").tobytes()

    @property
    def _planes(self) -> dict[Plane, dict[int, int]]:
        return plane_channels(self._config.maps, self._config.output_channels)

    @property
    def record_fields(self) -> TextureFields:
        planes = len(self._planes)
        return (("mean", "<f4", (planes * self._config.mips, 4)), ("axes", "<f4", (4 * planes, 4)))

    def fill_record_fields(self, record: np.void, texture: EncodedTexture) -> None:
        """Components that the codec lacks stay 0."""
        block_texture, mips = cast(BlockTexture, texture), self._config.mips
        for place, channels in enumerate(self._planes.values()):
            components, numbers = list(channels), list(channels.values())
            for mip in range(mips):
                record["mean"][place * mips + mip][components] = block_texture.mean[mip, numbers]
            # GLSL reads an axis at a time: a column.
            axes = block_texture.axes[np.ix_(numbers, numbers)].T
            record["axes"][4 * place : 4 * place + 4][np.ix_(components, components)] = axes

    def level_rows(self, texture: EncodedTexture) -> tuple[StoredRows, ...]:
        levels = texture_levels(texture, self._config)
        return level_rows(cast(BlockTexture, texture).words, levels, self._config)

    def latent_words(self, texture: EncodedTexture, rows: slice) -> Words:
        return np.ascontiguousarray(cast(BlockTexture, texture).words[rows, None], "<u4")

    def defines(self) -> list[str]:
        config = self._config
        values = {
            "BLOCK_SIDE": config.block_side,
            "CODE_MIPS": config.mips,
            "CODE_SIZES": len(config.block_words),
            **{f"CLASS_{number}_WORDS": words for number, words in enumerate(_four(config.block_words))},
            "DIRECTORY_RUN": DIRECTORY_RUN,
            "MODES": config.modes,
            "PLANES": len(config.planes),
            "EMPTY_BLOCK": self.heads,
            "TABLE_BLOCKS": self.decoder_blocks,
            "ROW_WORDS": AT_ONCE * self.row_blocks,
            **{f"MIP_{mip}_WORDS": sum(self._row_words[:mip]) for mip in range(config.mips)},
            "SQUARES_WORD": sum(self._row_words[:-2]),
            "STRIPS_WORD": self._row_words[-2],
            "STRIP_WORDS": STRIP_WORDS,
            "TRELLIS_SUBSETS": f"{trellis_subsets()}u",
            "STEPS_ORIGIN": STEPS_ORIGIN,
            "STEPS_PER_OCTAVE": SCALE_STEPS_PER_OCTAVE,
            "DEEP_DEPTH": f"{DEEP_DEPTH}u",
            "SHALLOW_CURVE": f"vec2{SHALLOW_CURVE}",
            "DEEP_CURVE": f"vec2{DEEP_CURVE}",
            "COLOUR_BITS": COLOUR_BITS,
            "LARGEST_FOURS": -(-self.most_coefficients // AT_ONCE),
        }
        lines = [f"#define {name} {value}" for name, value in values.items()]
        return lines + defines_by_plane(config, lambda _, channels: _edge_defines(config, channels))


def _four(sizes: tuple[int, ...]) -> tuple[int, ...]:
    """Words by size class; classes that the codec lacks, and no directory names, as the smallest."""
    return (*sizes, *[sizes[0]] * (LARGEST_SIZES - len(sizes)))


def _edge_defines(config: BlockConfig, channels: Mapping[int, int]) -> dict[str, str]:
    """Defines for a plane that has these `channels` by component: how many, a colour whose bits begin at `at`, which are
    sRGB-coded (those of a base where its texture says so), and whether means of coarse mips count beside edge parts."""
    places = {component: place for place, component in enumerate(channels)}
    always, often = (srgb_channels(config.maps, config.output_channels, space) for space in ("linear", "srgb"))
    coded = ["1.0" if one else "srgb" if other else "0.0" for one, other in zip(always, often, strict=True)]
    colours = [coded[channels[component]] if component in channels else "0.0" for component in range(4)]
    parts = [
        f"code_byte(code, at + {COLOUR_BITS * places[component]})" if component in places else "0.0"
        for component in range(4)
    ]
    return {
        "EDGE_CHANNELS": str(len(channels)),
        "EDGE_COLOUR(code, at)": f"vec4({', '.join(parts)})",
        "EDGE_COLOURS(srgb)": f"vec4({', '.join(colours)})",
        "EDGE_MEANS": str(int(config.alpha in channels.values())),
    }
