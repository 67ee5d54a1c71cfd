"""Lists of texels decoded by torch: on a CUDA device, whose units for products of halves OpenGL has no access to, or on the CPU."""

from collections.abc import Callable, Sequence
from functools import partial

import moderngl
import torch
from torch import Tensor

from ntc.accuracy.rescale import stored_pack
from ntc.codec.maps import Plane, plane_channels
from ntc.codec.model import Pack
from ntc.codec.torch_block import torch_codec
from viewer.render.resources.layout import WRAP_CODES
from viewer.render.resources.texel_lists import VALUE_BYTES, MakeListDecoder, SharedBuffer
from viewer.state.view_state import Precision

WRAP_MODES = {int(code): mode for mode, code in WRAP_CODES.items()}
UNIT = 2.0**-32
"""Of the coordinates in TEXEL_RECORD."""


class CopiedBuffer:
    """A buffer that is copied by way of the CPU's memory, pinned where a CUDA device reads it."""

    def __init__(self, buffer: moderngl.Buffer, device: torch.device) -> None:
        self._buffer, self._device = buffer, device
        shape = (buffer.size // VALUE_BYTES, 4)
        self._words = torch.zeros(shape, dtype=torch.int32, pin_memory=device.type == "cuda")

    def read(self, rows: int) -> Tensor:
        """[rows, 4] int32 on the device."""
        words = self._words[:rows]
        self._buffer.read_into(words.numpy(), size=rows * VALUE_BYTES)
        return words.to(self._device)

    def write(self, values: Tensor) -> None:
        """Replace the first rows by `values` [rows, 4] float32."""
        words = self._words[: len(values)]
        words.copy_(values.view(torch.int32))
        self._buffer.write(words.numpy())

    def release(self) -> None:
        """Nothing: the buffer is not held."""


class TorchListDecoder:
    """Decodes lists of texels, those of each texture together."""

    def __init__(
        self,
        pack: Pack,
        texture_index: Sequence[int],
        precision: Precision,
        device: torch.device,
        share: Callable[[moderngl.Buffer, torch.device], SharedBuffer] = CopiedBuffer,
    ) -> None:
        """In every precision but fp32 the layers of networks are products of halves."""
        self._texture_index, self._device, self._share = tuple(texture_index), device, share
        self._half = precision != "fp32"
        self.replace(pack)

    def share(self, buffer: moderngl.Buffer) -> SharedBuffer:
        """`buffer` for reading and writing."""
        return self._share(buffer, self._device)

    def replace(self, pack: Pack) -> None:
        """Decode another version of the pack from now on."""
        # What a layer hands on has to stay in the range of halves.
        self._pack = stored_pack(pack, "fp16-accumulate") if self._half else pack
        self._codec = torch_codec(self._pack, self._device, half=self._half)

    @torch.no_grad()
    def decode(self, texels: SharedBuffer, values: SharedBuffer, count: int, plane: Plane) -> None:
        """Decode the first `count` TEXEL_RECORDs of `texels` into `values`."""
        words = texels.read(count)
        # Units of 2^-32 are unsigned, and need more digits than float32 has.
        at = (words[:, :2].to(torch.int64) & 0xFFFFFFFF).double() * UNIT
        lod = torch.nan_to_num(words[:, 2].contiguous().view(torch.float32), posinf=0.0, neginf=0.0)
        codes, order = torch.sort(words[:, 3], stable=True)
        found, lengths = torch.unique_consecutive(codes, return_counts=True)
        decoded = torch.zeros((count, 4), device=self._device)
        for code, own in zip(found.tolist(), torch.split(order, lengths.tolist()), strict=True):
            if code >= 0:
                self._decode_texture(code, plane, own, at[own], lod[own], decoded)
        values.write(decoded)

    def _decode_texture(self, code: int, plane: Plane, rows: Tensor, at: Tensor, lod: Tensor, decoded: Tensor) -> None:
        """Decode texels of the texture and wrap modes of `code` into `rows` of `decoded`."""
        index = self._texture_index[code >> 4]
        texture = self._pack.textures[index]
        places = plane_channels(texture.maps, texture.channels).get(plane, {})
        modes = WRAP_MODES[code >> 2 & 3], WRAP_MODES[code & 3]
        texels = torch.nan_to_num(self._codec.texels(index, at, lod, modes))
        components = torch.tensor(list(places), dtype=torch.int64, device=self._device)
        decoded[rows[:, None], components] = texels[:, list(places.values())]


def make_lists() -> MakeListDecoder:
    """What decodes on the CPU: the twin of what a CUDA device does."""
    return partial(TorchListDecoder, device=torch.device("cpu"))
