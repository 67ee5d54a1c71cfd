"""BC1, BC7 and ASTC in the window: encoded beside the frames, shown when they are there, with their bits and bytes."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.quality import psnr_db
from ntc.errors import InputError
from ntc.metrics import block_compression
from ntc.metrics.block_compression import missing_packages
from ntc.metrics.compressed_textures import CompressedTexture, CompressionRequest, compress_texture
from tests.support.driven_app import DrivenApp
from viewer.commands import run, run_line
from viewer.commands.compare import source_refusal
from viewer.inspect import slot_jobs
from viewer.inspect.memory_table import compressed_memory
from viewer.inspect.texture_table import compressed_rows
from viewer.state.view_state import Slot

pytest.importorskip("quicktex")
pytest.importorskip("astc_encoder")


class HeldHelpers:
    """Encode in the caller's thread, and not before they may."""

    def __init__(self) -> None:
        self.function: Callable[[CompressionRequest], CompressedTexture] = compress_texture
        self.may_go = True
        self.calls = 0

    def call(
        self, _name: str, _function: object, request: CompressionRequest, check: Callable[[], None]
    ) -> CompressedTexture:
        self.calls += 1
        while not self.may_go:
            check()
            time.sleep(0.005)
        return self.function(request)


@pytest.fixture
def helpers(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> HeldHelpers:
    """What the application of a test encodes in, with a cache of its own."""
    monkeypatch.setenv("NTC_VIEWER_CACHE_DIR", str(tmp_path / "cache"))
    made = HeldHelpers()
    monkeypatch.setattr(slot_jobs, "HELPERS", made)
    return made


@pytest.fixture
def driven(helpers: HeldHelpers, app: DrivenApp) -> DrivenApp:
    """An application whose encodings are held by `helpers`."""
    return app


def toasts(app: DrivenApp) -> str:
    return " ".join(toast.text for toast in app.session.window.toasts)


def test_a_slot_keeps_what_it_shows_until_the_textures_are_encoded(driven: DrivenApp, helpers: HeldHelpers) -> None:
    before, helpers.may_go = driven.session.view.slot_a, False
    driven.run("slot.source", "a", "bc1")
    driven.frame(3)
    assert driven.session.view.slot_a == before
    assert not driven.is_settled
    assert "A encoding" in driven.widgets.labels()
    helpers.may_go = True
    driven.until(lambda: driven.is_settled)
    assert driven.session.view.slot_a.source == "bc1"
    assert "A encoding" not in driven.widgets.labels()
    assert "A path" not in driven.widgets.labels()
    # All mips count, over the texels of mip 0.
    sizes = [texture.size for texture in driven.session.scene.textures]
    blocks = sum(
        -(-max(width >> level, 1) // 4) * -(-max(height >> level, 1) // 4)
        for width, height in sizes
        for level in range(max(width, height).bit_length())
    )
    bits = 64.0 * blocks / sum(width * height for width, height in sizes)
    assert f"bc1: {bits:.2f} bits per texel" in toasts(driven)
    # What is there is shown at once.
    driven.run("slot.source", "b", "bc1")
    assert driven.session.view.slot_b.source == "bc1"
    assert helpers.calls == len(driven.session.scene.textures)


def test_the_picture_is_that_of_the_decoded_blocks(driven: DrivenApp) -> None:
    run_line(driven.context, "compare.mode a")
    pictures = {}
    for source in ("reference", "astc-4x4", "astc-12x12"):
        driven.run("slot.source", "a", source)
        driven.until(lambda: driven.is_settled)
        renderer = driven.frontend.picture.renderer
        assert renderer is not None
        pictures[source] = (renderer.picture(Slot(source)) * 255.0).astype(np.uint8)
    near, far = (psnr_db(pictures[name], pictures["reference"]) for name in ("astc-4x4", "astc-12x12"))
    assert 25.0 < far < near
    assert not np.isinf(near)
    # Only the images of what slots show stay on the GPU.
    assert driven.frontend.picture.renderer is not None
    assert set(driven.frontend.picture.renderer.images._passes) == {("astc-12x12", "base")}


def test_a_missing_encoder_is_one_message_and_changes_nothing(driven: DrivenApp, helpers: HeldHelpers) -> None:
    def missing(_request: CompressionRequest) -> CompressedTexture:
        raise InputError("block compression: the packages are not installed (x); pip install 'ntc-viewer[lab]'")

    helpers.function, before = missing, driven.session.view
    driven.run("slot.source", "b", "bc7")
    driven.until(lambda: driven.is_settled)
    assert driven.session.view.slot_b == before.slot_b
    assert "bc7: block compression: the packages are not installed" in toasts(driven)


def test_measure_tables_and_flat_window_have_its_figures(driven: DrivenApp) -> None:
    driven.run("slot.source", "a", "bc1")
    driven.until(lambda: driven.is_settled)
    driven.run("compare.measure")
    driven.frame(2)
    session = driven.session
    blocks = session.compressed["bc1"]
    figures = session.inspection.measurements["a"]
    assert (figures.source, figures.gpu_bytes, figures.divergence) == ("bc1", blocks.stored_bytes, None)
    assert figures.psnr_db is not None
    (row,) = compressed_memory(blocks)
    assert row.bytes == sum(texture.stored_bytes for texture in blocks.textures)
    textures = compressed_rows(session.scene, blocks)
    assert [row.psnr_db for row in textures] == [texture.psnr_db for texture in blocks.textures]
    for panel in ("Memory", "Textures", "Groups"):
        driven.show_panel(panel)
    driven.run("texture.flat", "0")
    driven.settle()
    driven.until(lambda: driven.is_settled)
    assert "flat picture" in driven.widgets.labels()


def test_the_status_bar_shows_an_encoding_and_ends_it(driven: DrivenApp, helpers: HeldHelpers) -> None:
    before, helpers.may_go = driven.session.view.slot_a, False
    assert "work" not in driven.widgets.labels()
    driven.run("slot.source", "a", "bc1")
    driven.frame(3)
    assert driven.widgets.tips["work"] == "encoding bc1: 0 %"
    driven.click("cancel work")
    assert driven.session.awaited_formats == {}
    assert "work" not in driven.widgets.labels()
    assert driven.session.view.slot_a == before


def test_formats_whose_encoders_are_missing_are_grey_with_the_line_that_installs_them(
    driven: DrivenApp, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(block_compression, "find_spec", lambda name: None if name == "astc_encoder" else object())
    missing_packages.cache_clear()
    try:
        assert source_refusal(driven.session, "bc7") == ""
        reason = source_refusal(driven.session, "astc-6x6")
        assert reason == f"astc_encoder not installed: {block_compression.INSTALL_HINT}"
        with pytest.raises(InputError, match="not installed"):
            run(driven.context, "slot.source", "a", "astc-6x6")
    finally:
        missing_packages.cache_clear()
