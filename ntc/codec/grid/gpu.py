"""Data of codec `grid` for GPUs, as shaders/ntc/grid.glsl reads them: latents, weights in a precision, and the network as GLSL."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import LARGEST_HALF, Precision
from ntc.codec.gpu import DecoderVariant, GpuTables, StoredRows, TextureFields, by_plane
from ntc.codec.grid.model import LOD_INPUT_SCALE, Adapter, GridConfig, GridDecoder, GridTexture
from ntc.codec.grid.tensors import packed_cells
from ntc.codec.latents import texture_levels
from ntc.codec.model import Decoder, EncodedTexture

PARTS = "xyzw"


def _add_product(sum_name: str, odd_name: str, number: int, weight: str, value: str) -> str:
    """Return GLSL that adds weight * value of input `number` to the sums of four neurons (shaders/ntc/half.glsl)."""
    if number % 2:
        return f"ADD_ODD_PRODUCT({sum_name}, {odd_name}, {weight}, {value});"
    return f"ADD_PRODUCT({sum_name}, {weight}, {value});"


def _biases(result: str, channels: Mapping[int, int], fetch: Callable[..., str]) -> list[str]:
    """Return GLSL that declares a plane's `result` with the biases of its channels; `fetch` returns GLSL that reads four biases."""
    parts = {component: f"float({fetch(channel // 4)}.{PARTS[channel % 4]})" for component, channel in channels.items()}
    return [f"    vec4 {result} = vec4({', '.join(parts.get(component, '0.0') for component in range(4))});"]


class NetworkLayout:
    """The layout of one decoder's weights in GPU memory, in blocks of four numbers.

    First and second layer: for each block of four outputs, for each input, the weights of the four outputs; then the biases.
    Third layer: for each output, for each block of four hidden values, their weights; then the biases.
    """

    def __init__(self, config: GridConfig) -> None:
        self.inputs = config.decoder_inputs
        self.hidden = config.hidden_width
        self.hidden_blocks = config.hidden_width // 4
        self.outputs = config.output_channels
        self.first_bias = self.hidden_blocks * self.inputs
        self.second = self.first_bias + self.hidden_blocks
        self.second_bias = self.second + self.hidden_blocks * self.hidden
        self.third = self.second_bias + self.hidden_blocks
        self.third_bias = self.third + self.outputs * self.hidden_blocks
        self.bias_blocks = -(-self.outputs // 4)
        self.blocks = self.third_bias + self.bias_blocks
        self.adapter_output = 4 * self.hidden_blocks
        self.adapter_output_bias = self.adapter_output + self.outputs * self.hidden_blocks
        output_blocks = self.outputs * self.hidden_blocks + self.bias_blocks if config.adapter_output else 0
        self.adapter_blocks = self.adapter_output + output_blocks if config.adapters else 0

    def arrange(self, decoder: GridDecoder) -> NDArray[np.float32]:
        """Return [blocks, 4] float32: the weights of `decoder` in this layout."""
        first, second, third = decoder.weights
        arranged = [
            first.reshape(self.hidden_blocks, 4, self.inputs).transpose(0, 2, 1),
            decoder.biases[0],
            second.reshape(self.hidden_blocks, 4, self.hidden).transpose(0, 2, 1),
            decoder.biases[1],
            third,
            np.pad(decoder.biases[2], (0, -self.outputs % 4)),
        ]
        return np.concatenate([part.reshape(-1, 4) for part in arranged]).astype(np.float32)


def arrange_adapter(adapter: Adapter) -> NDArray[np.float32]:
    """Return [blocks, 4] float32: scales and biases of the first hidden layer, then of the second. An output layer follows in the
    layout of the decoder's."""
    pairs = zip(adapter.scales, adapter.biases, strict=True)
    parts = [part for pair in pairs for part in pair]
    if adapter.output_weight is not None and adapter.output_bias is not None:
        parts += [adapter.output_weight, np.pad(adapter.output_bias, (0, -len(adapter.output_bias) % 4))]
    return np.concatenate([part.reshape(-1, 4) for part in parts]).astype(np.float32)


def network_glsl(config: GridConfig) -> str:
    """Return the include `generated/network.glsl`: `vec4 run_decoder(int decoder, int adapter, float x[DECODER_INPUTS], int blocks)`.

    `adapter` is the first block of the texture's adapter, unused if the codec has none. `blocks` is the number of hidden blocks, or 0
    to skip the decoder. It must come from a uniform: llvmpipe unrolls a loop of known length, and then compiles for minutes.
    """
    layout = NetworkLayout(config)
    slope = repr(float(config.leaky_slope))

    def start(bias: int) -> list[str]:
        first = "0.0" if config.adapters else f"weight(base + {bias} + k)"
        return [f"        ACC_T sum = ACC_T({first});", "        ODD_ACCUMULATOR(odd)"]

    def finish(hidden_layer: int) -> list[str]:
        join = "        JOIN_ACCUMULATORS(sum, odd)"
        if not config.adapters:
            return [join]
        scales = 2 * hidden_layer * layout.hidden_blocks
        biases = scales + layout.hidden_blocks
        return [join, f"        sum = ADAPTED(sum, weight(adapter + {scales} + k), weight(adapter + {biases} + k));"]

    third, third_bias = f"base + {layout.third}", f"base + {layout.third_bias}"
    if config.adapter_output:
        third, third_bias = f"adapter + {layout.adapter_output}", f"adapter + {layout.adapter_output_bias}"
    lines = [
        "// Generated from ntc/codec/grid/gpu.py for one GridConfig.",
        "vec4 run_decoder(int decoder, int adapter, float x[DECODER_INPUTS], int blocks) {",
        f"    int base = decoder * {layout.blocks};",
        f"    MUL_T hidden[{layout.hidden_blocks}];",
        "    for (int k = 0; k < blocks; ++k) {",
        f"        int row = base + k * {layout.inputs};",
        *start(layout.first_bias),
        *[
            f"        {_add_product('sum', 'odd', i, f'MUL_T(weight(row + {i}))', f'MUL_SCALAR(x[{i}])')}"
            for i in range(layout.inputs)
        ],
        *finish(0),
        f"        hidden[k] = AS_MUL_T(LEAKY(sum, {slope}));",
        "    }",
        *by_plane(config, lambda _, channels: _biases("result", channels, f"weight({third_bias} + {{}})".format)),
        "    for (int k = 0; k < blocks; ++k) {",
        f"        int row = base + {layout.second} + k * {layout.hidden};",
        *start(layout.second_bias),
    ]
    for block in range(layout.hidden_blocks):
        lines.append(f"        {{ MUL_T h = hidden[{block}];")
        lines += [
            "          "
            + _add_product("sum", "odd", part, f"MUL_T(weight(row + {4 * block + part}))", f"h.{PARTS[part]}")
            for part in range(4)
        ]
        lines.append("        }")
    lines += [*finish(1), f"        sum = LEAKY(sum, {slope});"]
    lines += by_plane(
        config,
        lambda _, channels: [
            f"        result.{PARTS[component]} += PRODUCT_SUM(sum, weight({third} + {channel * layout.hidden_blocks} + k));"
            for component, channel in channels.items()
        ],
    )
    lines += ["    }", "    return result;", "}", ""]
    return "\n".join(lines)


def _first_results(config: GridConfig, layout: NetworkLayout, channels: Mapping[int, int], pixels: int) -> list[str]:
    """Return GLSL that declares the result of each pixel with the biases of the output layer."""
    lines = []
    for p in range(pixels):
        adapter_weight = f"weight(adapters[{p}] + {layout.adapter_output_bias} + {{}})"
        fetch = adapter_weight if config.adapter_output else f"decoder_weight({layout.third_bias} + {{}})"
        lines += _biases(f"result{p}", channels, fetch.format)
    return lines


def _add_outputs(config: GridConfig, layout: NetworkLayout, channels: Mapping[int, int], pixels: int) -> list[str]:
    """Return GLSL that adds the products of four hidden values with the weights of the output layer."""
    lines = []
    for component, channel in channels.items():
        offset = channel * layout.hidden_blocks
        if not config.adapter_output:
            lines.append(f"        WEIGHT_T out{component} = decoder_weight({layout.third + offset} + k);")
        for p in range(pixels):
            adapter_weight = f"weight(adapters[{p}] + {layout.adapter_output + offset} + k)"
            weight = adapter_weight if config.adapter_output else f"out{component}"
            lines.append(f"        result{p}.{PARTS[component]} += PRODUCT_SUM(sum{p}, {weight});")
    return lines


CHUNK = 4
"""Weights that are fetched at once, before they are multiplied: few enough that the sums of all pixels stay in registers."""


def shared_network_glsl(config: GridConfig, variant: DecoderVariant) -> str:
    """Return the include `generated/shared_decoder.glsl`: `run_decoders` decodes PIXELS pixels with one decoder.

    The weights of that decoder alone are bound, so their addresses do not depend on the pixel:
    `void run_decoders(int adapters[PIXELS], float x[PIXELS][DECODER_INPUTS], int blocks, out vec4 results[PIXELS])`;
    `blocks` as in `network_glsl`.
    """
    layout = NetworkLayout(config)
    slope = repr(float(config.leaky_slope))
    pixels = range(variant.pixels)
    unrolled = math.gcd(layout.hidden_blocks, variant.unrolled)
    is_whole = unrolled == layout.hidden_blocks
    # With all blocks unrolled, each hidden value is assigned before it is read. Otherwise the conditional below reads it first.
    unknown = "" if is_whole else " = MUL_T(0.0)"

    def start(bias: int) -> list[str]:
        first = "0.0" if config.adapters else f"decoder_weight({bias} + k)"
        sums = [f"        ACC_T sum{p} = first; ODD_ACCUMULATOR(odd{p})" for p in pixels]
        return [f"        ACC_T first = ACC_T({first});", *sums]

    def products(row: str, values: Sequence[Sequence[str]]) -> list[str]:
        """Return GLSL that adds the products of the weights from `row` on with `values[p]`, for each pixel p."""
        lines = []
        for first in range(0, len(values[0]), CHUNK):
            numbers = range(first, min(first + CHUNK, len(values[0])))
            lines.append("        {")
            lines += [f"          MUL_T w{i - first} = MUL_T(decoder_weight({row} + {i}));" for i in numbers]
            lines += [
                "          "
                + " ".join(_add_product(f"sum{p}", f"odd{p}", i, f"w{i - first}", values[p][i]) for i in numbers)
                for p in pixels
            ]
            lines.append("        }")
        return lines

    def finish(hidden_layer: int) -> list[str]:
        lines = []
        for p in pixels:
            lines.append(f"        JOIN_ACCUMULATORS(sum{p}, odd{p})")
            if config.adapters:
                scales = 2 * hidden_layer * layout.hidden_blocks
                biases = scales + layout.hidden_blocks
                lines.append(
                    f"        sum{p} = ADAPTED(sum{p}, weight(adapters[{p}] + {scales} + k), "
                    f"weight(adapters[{p}] + {biases} + k));"
                )
            lines.append(f"        sum{p} = LEAKY(sum{p}, {slope});")
        return lines

    lines = [
        "// Generated from ntc/codec/grid/gpu.py for one GridConfig.",
        f"#define DECODER_BLOCKS {layout.blocks}",
        f"#define PIXELS {variant.pixels}",
        '#include "ntc/decoder_weights.glsl"',
        "void run_decoders(int adapters[PIXELS], float x[PIXELS][DECODER_INPUTS], int blocks, out vec4 results[PIXELS]) {",
        *(f"    MUL_T hidden{p}_{k}{unknown};" for p in pixels for k in range(layout.hidden_blocks)),
        f"    for (int step = 0; step < blocks; step += {unrolled}) {{",
    ]
    for number in range(unrolled):
        # Not an array: a varying index makes a CPU store it lane by lane, and keeps the whole array out of registers.
        stored = [
            f"        hidden{p}_{k} = {'' if is_whole else f'k != {k} ? hidden{p}_{k} : '}AS_MUL_T(sum{p});"
            for k in range(number, layout.hidden_blocks, unrolled)
            for p in pixels
        ]
        lines += [
            f"        {{ int k = {number if is_whole else f'step + {number}'};",
            f"        int row = k * {layout.inputs};",
            *start(layout.first_bias),
            *products("row", [[f"MUL_SCALAR(x[{p}][{i}])" for i in range(layout.inputs)] for p in pixels]),
            *finish(0),
            *stored,
            "        }",
        ]
    lines.append("    }")

    lines += by_plane(config, lambda _, channels: _first_results(config, layout, channels, variant.pixels))
    lines += [
        "    for (int k = 0; k < blocks; ++k) {",
        f"        int row = {layout.second} + k * {layout.hidden};",
        *start(layout.second_bias),
    ]
    lines += products("row", [[f"hidden{p}_{i // 4}.{PARTS[i % 4]}" for i in range(layout.hidden)] for p in pixels])
    lines += finish(1)

    lines += by_plane(config, lambda _, channels: _add_outputs(config, layout, channels, variant.pixels))
    lines += ["    }", *(f"    results[{p}] = result{p};" for p in pixels), "}", ""]
    return "\n".join(lines)


class GridTables(GpuTables):
    """GPU data of codec `grid`. Weights are fp32, or halves in all other precisions; those beyond the range become the largest
    half."""

    shares_decoders = True
    shader = "ntc/grid.glsl"

    def __init__(self, settings: GridConfig, precision: Precision) -> None:
        super().__init__(settings)
        self._config, self.precision = settings, precision
        self.number_type = "f4" if precision == "fp32" else "f2"
        self._network = NetworkLayout(settings)
        self.decoder_blocks, self.adapter_blocks = self._network.blocks, self._network.adapter_blocks
        self.loop_length = self._network.hidden_blocks
        self.row_words = -(-settings.cell_bytes // 4)

    def _data(self, numbers: NDArray[np.float32]) -> bytes:
        if self.precision != "fp32":
            return np.clip(numbers, -LARGEST_HALF, LARGEST_HALF).astype("<f2").tobytes()
        return numbers.astype("<f4").tobytes()

    def decoder_data(self, decoder: Decoder) -> bytes:
        return self._data(self._network.arrange(cast(GridDecoder, decoder)))

    def adapter_data(self, texture: EncodedTexture) -> bytes:
        adapter = cast(GridTexture, texture).adapter
        return b"" if adapter is None else self._data(arrange_adapter(adapter))

    @property
    def record_fields(self) -> TextureFields:
        words = self._config.latent_channels // 4
        return (("scale", "<f4", (words, 4)), ("offset", "<f4", (words, 4)))

    def fill_record_fields(self, record: np.void, texture: EncodedTexture) -> None:
        grid_texture = cast(GridTexture, texture)
        record["scale"] = grid_texture.scale.reshape(-1, 4)
        record["offset"] = grid_texture.offset.reshape(-1, 4)

    def level_rows(self, texture: EncodedTexture) -> tuple[StoredRows, ...]:
        levels = texture_levels(texture, self._config)
        return tuple(StoredRows(level.first_cell, level.cells) for level in levels)

    def latent_words(self, texture: EncodedTexture, rows: slice) -> NDArray[np.uint32]:
        """Return [rows, row_words] uint32: cells as packs store them, padded to whole words."""
        packed = packed_cells(cast(GridTexture, texture).latents[rows], self._config.latent_bits)
        padding = 4 * self.row_words - packed.shape[1]
        return np.ascontiguousarray(np.pad(packed, ((0, 0), (0, padding)))).view("<u4")

    def defines(self) -> list[str]:
        config = self._config
        values = {
            "LATENT_WORDS": config.latent_channels // 4,
            "LATENT_BITS": config.latent_bits,
            "LATENT_CHANNELS": config.latent_channels,
            "POSITIONAL_OCTAVES": config.positional_octaves,
            "POSITIONAL_INPUTS": config.positional_inputs,
            "LOD_INPUTS": config.lod_inputs,
            "LOD_INPUT_SCALE": LOD_INPUT_SCALE,
            "DECODER_INPUTS": config.decoder_inputs,
        }
        return [f"#define {name} {value}" for name, value in values.items()]

    def includes(self, variant: DecoderVariant) -> dict[str, str]:
        return {
            **super().includes(variant),
            "generated/network.glsl": network_glsl(self._config),
            "generated/shared_decoder.glsl": shared_network_glsl(self._config, variant),
        }
