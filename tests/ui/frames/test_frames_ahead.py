"""A window without a screen draws no further ahead than one with a screen: drivers keep what frames ahead need."""

import pytest

from tests.ui.conftest import Opener
from viewer.app import headless
from viewer.app.headless import FRAMES_AHEAD
from viewer.gl.read_back import Fence


def test_no_more_frames_are_under_way_than_with_a_screen(open_window: Opener, monkeypatch: pytest.MonkeyPatch) -> None:
    put: list[Fence] = []
    passed: list[Fence] = []

    class NotedFence(Fence):
        """Notes when it was put, and when it was waited for."""

        def __init__(self, *arguments: object) -> None:
            super().__init__(*arguments)  # type: ignore[arg-type]
            put.append(self)

        def wait(self) -> None:
            super().wait()
            passed.append(self)

    app = open_window(live_figures=False)
    app.settle()
    monkeypatch.setattr(headless, "Fence", NotedFence)
    for _ in range(20):
        app.frame()
        assert all(fence in passed for fence in put[:-FRAMES_AHEAD])
    assert len(put) == 20
