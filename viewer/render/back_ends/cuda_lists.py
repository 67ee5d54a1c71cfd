"""Lists of texels decoded on the CUDA device that draws, which reads and writes OpenGL's buffers where they are.

Never run by its authors: no machine with CUDA was at hand. Its arithmetic is that of the twin on the CPU, which is tested.
"""

from functools import partial
from typing import Any, Final

import moderngl
import torch
from torch import Tensor

from ntc.errors import InputError
from viewer.render.back_ends.torch_lists import CopiedBuffer, TorchListDecoder
from viewer.render.resources.texel_lists import VALUE_BYTES, MakeListDecoder, SharedBuffer

ALL_DEVICES: Final = 1
"""cudaGLDeviceListAll."""
NO_FLAGS: Final = 0
"""cudaGraphicsRegisterFlagsNone: for reading and writing."""


def cuda_runtime() -> Any:
    """cuda-python's module of the CUDA runtime; None where it is not installed."""
    try:
        from cuda.bindings import runtime
    except ImportError:
        return None
    return runtime


def checked(result: tuple[Any, ...]) -> tuple[Any, ...]:
    """What a call of the CUDA runtime returned besides its status. Raises RuntimeError where that is not 0."""
    status, *values = result
    if int(status) != 0:
        raise RuntimeError(f"CUDA: {status}")
    return tuple(values)


class _Memory:
    """Memory of a CUDA device, by the protocol from which torch makes tensors without a copy."""

    def __init__(self, address: int, rows: int) -> None:
        self.__cuda_array_interface__ = {"shape": (rows, 4), "typestr": "<i4", "data": (address, False), "version": 3}


class MappedBuffer:
    """A buffer of OpenGL that CUDA reads and writes where it is."""

    def __init__(self, buffer: moderngl.Buffer, device: torch.device, runtime: Any) -> None:
        """Raises RuntimeError where CUDA cannot have it, for instance of another GPU."""
        self._runtime, self._device, self._rows = runtime, device, buffer.size // VALUE_BYTES
        (self._resource,) = checked(runtime.cudaGraphicsGLRegisterBuffer(buffer.glo, NO_FLAGS))

    def _copy(self, rows: int, values: Tensor | None) -> Tensor:
        """Copy the first rows out of the buffer, or `values` into it.

        Mapping waits for what OpenGL was told before, unmapping lets OpenGL wait for the copy.
        """
        stream = torch.cuda.current_stream(self._device).cuda_stream
        checked(self._runtime.cudaGraphicsMapResources(1, self._resource, stream))
        try:
            address, _ = checked(self._runtime.cudaGraphicsResourceGetMappedPointer(self._resource))
            mapped = torch.as_tensor(_Memory(int(address), self._rows), device=self._device)[:rows]
            return mapped.clone() if values is None else mapped.copy_(values.view(torch.int32))
        finally:
            checked(self._runtime.cudaGraphicsUnmapResources(1, self._resource, stream))

    def read(self, rows: int) -> Tensor:
        """[rows, 4] int32 on the device."""
        return self._copy(rows, None)

    def write(self, values: Tensor) -> None:
        """Replace the first rows by `values` [rows, 4] float32."""
        self._copy(len(values), values)

    def release(self) -> None:
        """Give the buffer back to OpenGL alone."""
        checked(self._runtime.cudaGraphicsUnregisterResource(self._resource))


def _share(buffer: moderngl.Buffer, device: torch.device) -> SharedBuffer:
    """Mapped where cuda-python is there and OpenGL draws on the same GPU, else by copies in pinned memory."""
    runtime = cuda_runtime()
    if runtime is not None:
        try:
            return MappedBuffer(buffer, device, runtime)
        except RuntimeError:
            pass
    return CopiedBuffer(buffer, device)


def _drawing_device() -> torch.device:
    """The CUDA device that the current OpenGL context draws on, as far as CUDA tells, else torch's first."""
    runtime = cuda_runtime()
    if runtime is not None:
        status, count, numbers = runtime.cudaGLGetDevices(1, runtime.cudaGLDeviceList(ALL_DEVICES))
        if int(status) == 0 and count:
            return torch.device("cuda", int(numbers[0]))
    return torch.device("cuda", 0)


def make_lists() -> MakeListDecoder:
    """What decodes on a CUDA device. Raises InputError where torch finds none. An OpenGL context is current."""
    if not torch.cuda.is_available():
        raise InputError(
            f"decoding with torch: version {torch.__version__} finds no CUDA device here; decode with glsl, or with torch-cpu, "
            "which computes the same on the processor"
        )
    return partial(TorchListDecoder, device=_drawing_device(), share=_share)
