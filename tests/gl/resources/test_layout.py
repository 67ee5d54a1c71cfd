"""Python records and GLSL structs have the same bytes: every field written by numpy is read back by a shader."""

from collections.abc import Iterator

import numpy as np
import pytest

from ntc.codec.block.config import BlockConfig
from ntc.codec.gpu import GPU, LEVEL_RECORD
from ntc.codec.grid.model import GridConfig
from ntc.codec.model import CodecSettings
from ntc.codec.registry import codec_of
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, ShaderLibrary
from viewer.locations import shaders_folder
from viewer.render.resources.layout import (
    MATERIAL_RECORD,
    REQUEST_RECORD,
    scene_includes,
)

pytestmark = pytest.mark.driver

CONFIGS = {channels: GridConfig(latent_channels=channels) for channels in (4, 12)}
BLOCK = BlockConfig()


def texture_record(config: CodecSettings) -> np.dtype:
    return codec_of(config).gpu_tables(config).texture_record


RECORDS: dict[str, tuple[np.dtype, CodecSettings]] = {
    "MaterialRecord": (MATERIAL_RECORD, CONFIGS[4]),
    "LevelRecord": (LEVEL_RECORD, CONFIGS[4]),
    "RequestRecord": (REQUEST_RECORD, CONFIGS[4]),
    "TextureRecord, 4 channels": (texture_record(CONFIGS[4]), CONFIGS[4]),
    "TextureRecord, 12 channels": (texture_record(CONFIGS[12]), CONFIGS[12]),
    "TextureRecord, block": (texture_record(BLOCK), BLOCK),
}


def components(record: np.dtype) -> list[str]:
    """GLSL expressions for all numbers of a record, in numpy's order."""
    found = []
    for field in record.names or ():
        base, shape = record[field].base, record[field].shape
        if base.names:
            found += [f"{field}[{number}].{part}" for number in range(shape[0]) for part in components(base)]
            continue
        places = [""] if shape == () else [f"[{i}]" for i in range(shape[0])]
        if len(shape) == 2:
            places = [f"[{i}][{j}]" for i in range(shape[0]) for j in range(shape[1])]
        found += [f"{field}{place}" for place in places]
    return found


def fill(record: np.void, values: Iterator[int]) -> None:
    """Write `values` into the numbers of a record, in the order of `components`."""
    for field in record.dtype.names or ():
        base, shape = record.dtype[field].base, record.dtype[field].shape
        if base.names:
            for part in record[field]:
                fill(part, values)
        else:
            record[field] = np.array([next(values) for _ in range(int(np.prod(shape)))]).reshape(shape)


@pytest.mark.parametrize("name", RECORDS)
def test_a_shader_reads_what_numpy_wrote(graphics: GraphicsContext, name: str) -> None:
    record, config = RECORDS[name]
    numbers = components(record)
    assert record.itemsize == 4 * len(numbers), "no hidden padding"
    # Small whole numbers, different in every place of every record, as int or as float.
    values = np.arange(3 * len(numbers)).reshape(3, -1)
    records = np.zeros(3, record)
    for row in range(3):
        fill(records[row], iter(values[row]))
    reads = [
        f"    found[gl_GlobalInvocationID.x * {len(numbers)} + {index}] = int(records[gl_GlobalInvocationID.x].{place});"
        for index, place in enumerate(numbers)
    ]
    shader = "\n".join(
        [
            "#version 430",
            "layout(local_size_x = 1) in;",
            '#include "generated/layout.glsl"',
            '#include "generated/codec.glsl"',
            f"layout(std430, binding = 0) readonly buffer Records {{ {name.split(',', maxsplit=1)[0]} records[]; }};",
            "layout(std430, binding = 1) writeonly buffer Found { int found[]; };",
            "void main() {",
            *reads,
            "}",
        ]
    )
    includes = codec_of(config).gpu_tables(config).includes(GPU)
    generated = {**scene_includes(), **includes, "test.comp": shader}
    factory = ProgramFactory(graphics.gl, ShaderLibrary(shaders_folder(), generated))
    source, result = graphics.gl.buffer(records.tobytes()), graphics.gl.buffer(reserve=values.size * 4)
    source.bind_to_storage_buffer(0)
    result.bind_to_storage_buffer(1)
    factory.compute("test.comp").run(3)
    graphics.gl.memory_barrier()
    assert np.frombuffer(result.read(), np.int32).tolist() == values.ravel().tolist()
    for part in (source, result, factory):
        part.release()


def test_records_are_whole_vectors() -> None:
    """std430 rounds a struct that holds a vec4 up to 16 bytes; the arrays' strides must not differ."""
    for record, _ in RECORDS.values():
        assert record.itemsize % 16 == 0
