"""Exported decoders in WGSL and C++ find the texels of the conformance packs."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.latents import latent_levels
from ntc.codec.maps import Plane, plane_channels
from ntc.codec.model import Pack
from ntc.codec.reference import texel_centres
from ntc.pack.file import read_pack
from tests.conformance.packs import FOLDER, MAKERS
from tests.conformance.test_conformance import steps_apart
from tests.end_to_end.export.test_shader import (
    REQUESTS,
    WRAP_MODES,
    exported,
    reference_program,
    run_program,
    run_wgsl,
    webgpu_device,
)

Decoder = Callable[[Plane, NDArray[Any]], NDArray[np.float32]]
"""(plane, [N] REQUESTS) -> [N, 4]."""

pytestmark = [pytest.mark.process, pytest.mark.nightly]


def centres(pack: Pack, number: int) -> list[NDArray[Any]]:
    """[N] REQUESTS for the centres of all texels, for each mip of a texture."""
    own = pack.textures[number]
    found = []
    for level, size in enumerate(latent_levels(own.width, own.height, pack.config)):
        at = texel_centres(size.texel_width, size.texel_height)
        requests = np.zeros(len(at), REQUESTS)
        requests["uv"], requests["lod"], requests["texture"] = at, level, number
        requests["wrap"] = [WRAP_MODES.index(mode) for mode in own.wrap]
        found.append(requests)
    return found


def decoded(pack: Pack, decode: Decoder) -> bytes:
    """All texels as NAME.texels has them."""
    parts = []
    for number, own in enumerate(pack.textures):
        for requests in centres(pack, number):
            texels = np.zeros((len(requests), own.channels), np.uint8)
            for plane, components in plane_channels(own.maps, own.channels).items():
                values = np.rint(np.clip(decode(plane, requests), 0.0, 1.0) * 255.0).astype(np.uint8)
                texels[:, list(components.values())] = values[:, list(components)]
            parts.append(texels.tobytes())
    return b"".join(parts)


@pytest.mark.parametrize("name", sorted(MAKERS))
def test_cpp_decodes_them(name: str, tmp_path: Path) -> None:
    own = exported(read_pack(FOLDER / f"{name}.ntc"), tmp_path, "glsl")
    program = reference_program(own.folder)
    data = own.folder / "ntc_pack.bin"
    assert steps_apart(decoded(own.pack, lambda *asked: run_program(program, data, *asked)), name) <= 1


@pytest.mark.parametrize("name", sorted(MAKERS))
def test_wgsl_decodes_them(name: str, tmp_path: Path) -> None:
    wgpu, device = webgpu_device()
    own = exported(read_pack(FOLDER / f"{name}.ntc"), tmp_path, "wgsl")
    assert steps_apart(decoded(own.pack, lambda *asked: run_wgsl(wgpu, device, own, *asked)), name) <= 1
