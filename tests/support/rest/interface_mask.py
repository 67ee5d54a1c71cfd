"""Mask of the pixels of a window that the user interface covers: labels, messages and lines over the picture."""

import ctypes

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

VERTEX_FLOATS = 5
"""Of ImGui's vertices: place, texture coordinates, and a colour of the same size as a float."""
SMALLEST = 0.5
"""Pixels that smoothed edges may reach beyond the corners of triangles."""


def covered_by_interface(picture: int, size: tuple[int, int]) -> NDArray[np.bool_]:
    """[H, W], row 0 on top: pixels of the last frame on which ImGui drew anything but the texture `picture`.

    `size` is the window's (width, height) in pixels.
    """
    mask = np.zeros((size[1], size[0]), np.bool_)
    data = imgui.get_draw_data()
    for commands in data.cmd_lists:
        vertices = _array(commands.vtx_buffer, np.dtype("f4"), VERTEX_FLOATS)
        indices = _array(commands.idx_buffer, np.dtype(f"u{imgui.INDEX_SIZE}"), 1)[:, 0]
        for command in commands.cmd_buffer:
            if command.get_tex_id() == picture:
                continue
            chosen = indices[command.idx_offset : command.idx_offset + command.elem_count] + command.vtx_offset
            _mark(mask, vertices[chosen.reshape(-1, 3), :2].astype(np.float64), command.clip_rect)
    return mask


def _mark(mask: NDArray[np.bool_], triangles: NDArray[np.float64], clip: imgui.ImVec4) -> None:
    """Mark the rectangles around `triangles` [T, 3, 2], as far as they are not clipped."""
    low = np.maximum(triangles.min(axis=1) - SMALLEST, (clip.x, clip.y))
    high = np.minimum(triangles.max(axis=1) + SMALLEST, (clip.z, clip.w))
    for (left, top), (right, bottom) in zip(np.floor(low).astype(int), np.ceil(high).astype(int), strict=True):
        mask[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)] = True


def _array(buffer: object, kind: np.dtype, columns: int) -> NDArray:
    """[N, columns]: a copy of what an ImVector holds."""
    size = len(buffer)  # type: ignore[arg-type]
    if size == 0:
        return np.zeros((0, columns), kind)
    address = buffer.data_address()  # type: ignore[attr-defined]
    return np.frombuffer(ctypes.string_at(address, size * columns * kind.itemsize), kind).reshape(size, columns)
