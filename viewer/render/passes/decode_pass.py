"""The interface that the decode passes share. The table of decode paths makes them (viewer/render/gpu_pack.py)."""

from abc import ABC, abstractmethod
from collections.abc import Sequence

import moderngl

from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.visibility_buffer import VisibilityInputs
from viewer.state.view_state import TexelFilter


def filter_defines(texel_filter: TexelFilter) -> dict[str, int]:
    """Defines of the decoding shaders for a filter; with the stochastic one they read `VisibilityInputs.sample`."""
    return {"FILTER_STOCHASTIC": int(texel_filter == "stochastic")}


class DecodePass(ABC):
    """Decodes one pack. Inputs: visibility buffer, materials, the pack's buffers. Output: a plane of the whole picture."""

    name: str
    """`decode_` and the name of the decode path."""

    @abstractmethod
    def run(self, inputs: VisibilityInputs, target: ColorTarget) -> None:
        """Decode every visible pixel once."""

    def own_buffers(self) -> Sequence[moderngl.Buffer]:
        """GPU buffers that belong to this pass alone."""
        return ()

    @property
    def bytes_on_gpu(self) -> int:
        """Size of the pass's own buffers."""
        return sum(buffer.size for buffer in self.own_buffers())

    def release(self) -> None:
        """Free the pass's own buffers."""
        for buffer in self.own_buffers():
            buffer.release()
