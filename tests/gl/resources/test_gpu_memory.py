"""A GPU without memory: whatever asks for it, one line says so, nothing is half-done, and what fits goes on."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.model import Pack
from tests.gl.small_scenes import FRONT, INSIDE, masks, pack_of
from tests.support.gpu_memory import PLENTY, FailingMemory, ForgetfulMemory, existing
from viewer.gl.allocation import GpuMemory, GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.render.frames import FrameResult, read_picture
from viewer.render.pass_scheduler import Budget, Step
from viewer.render.renderer import Renderer
from viewer.render.resources.tile_cache.budget import TileCacheConfig
from viewer.scene.model import Scene
from viewer.state.view_state import REFERENCE, Overlay, Slot, ViewState

pytestmark = pytest.mark.once
SIZE, LARGER = (40, 24), (56, 40)


TILES = TileCacheConfig(budget_bytes=1 << 22)


ONE_STEP = 1
"""A tile on another page is sampled at other coordinates, which are rounded elsewhere."""


@pytest.fixture(scope="module")
def scene() -> Scene:
    return masks()


@pytest.fixture(scope="module")
def packs(scene: Scene) -> tuple[Pack, Pack]:
    """One, and what a training makes of it."""
    return pack_of(scene), pack_of(scene, seed=1)


FORWARD, DEFERRED, BINNED, CACHED = (Slot("p", path) for path in ("forward", "deferred", "binned", "cached"))


VIEWS = {
    "reference": ViewState(FRONT, SIZE, Slot(REFERENCE)),
    "forward": ViewState(FRONT, SIZE, FORWARD),
    "deferred, divergence": ViewState(FRONT, SIZE, DEFERRED, overlay=Overlay("divergence")),
    "binned, marks": ViewState(FRONT, SIZE, BINNED, highlight=(1,)),
    "cached, elsewhere": ViewState(INSIDE, SIZE, CACHED),
    "cached and reference, larger": ViewState(
        FRONT, LARGER, CACHED, Slot(REFERENCE), compare="wipe", anisotropy=4, overlay=Overlay("divergence")
    ),
}


def is_short(frame: FrameResult) -> bool:
    """Whether it says that memory made it coarser."""
    return bool(frame.short_latents) or any(counts.out_of_memory for counts in frame.tiles.values())


class Window:
    """What a window does, step by step; a step that fails for want of memory is said and left."""

    def __init__(self, context: GraphicsContext, scene: Scene, packs: tuple[Pack, Pack]) -> None:
        self._context, self._scene, self._packs = context, scene, packs
        self.renderer: Renderer | None = None
        self.refusals: list[str] = []
        self.seen: dict[str, NDArray[np.uint8]] = {}

    def _try(self, step: Callable[[], object]) -> None:
        """At most twice: the next frame asks again."""
        for _ in range(2):
            try:
                step()
                return
            except GpuMemoryError as error:
                self.refusals.append(str(error))

    def _draw(self, name: str) -> None:
        assert self.renderer is not None
        self.seen.pop(name, None)
        frame = self.renderer.render(VIEWS[name], whole=True)
        if not is_short(frame):
            self.seen[name] = read_picture(frame.image)

    def _open(self) -> None:
        self.renderer = Renderer(self._context, self._scene, tile_cache=TILES)

    def run(self) -> None:
        self._try(self._open)
        renderer = self.renderer
        if renderer is None:
            return
        renderer.set_packs({"p": self._packs[1]})
        self._try(lambda: renderer.render(VIEWS["cached, elsewhere"], whole=True))
        renderer.set_packs({"p": self._packs[0]})
        self._try(lambda: renderer.prepare(FORWARD))
        for name in VIEWS:
            self._try(partial(self._draw, name))
            self._try(renderer.prepare_slots)
            self._try(renderer.prepare_comparison)

    def draw_again(self) -> dict[str, NDArray[np.uint8]]:
        """With all the memory there is; without pictures that say themselves that they are coarser."""
        for name in VIEWS:
            self._draw(name)
        return self.seen

    def reopen_pack(self) -> None:
        """Forget how little memory there was for it."""
        assert self.renderer is not None
        self.renderer.set_packs({})
        self.renderer.set_packs({"p": self._packs[0]})

    def close(self) -> None:
        if self.renderer is not None:
            self.renderer.release()


def opened(graphics: GraphicsContext, memory: GpuMemory, scene: Scene, packs: tuple[Pack, Pack]) -> Window:
    return Window(replace(graphics, memory=memory), scene, packs)


def assert_equal(pictures: Mapping[str, NDArray[np.uint8]], truth: Mapping[str, NDArray[np.uint8]]) -> None:
    for name, picture in pictures.items():
        allowed = ONE_STEP if "cached" in name else 0
        assert np.abs(picture.astype(int) - truth[name].astype(int)).max() <= allowed, name


@pytest.fixture(scope="module")
def truth(
    graphics: GraphicsContext, scene: Scene, packs: tuple[Pack, Pack]
) -> tuple[dict[str, NDArray[np.uint8]], int]:
    """The pictures, and how often memory is asked for until all has been drawn."""
    memory = FailingMemory(graphics.gl, -1)
    window = opened(graphics, memory, scene, packs)
    window.run()
    asked = memory.asked
    assert window.refusals == []
    pictures = dict(window.draw_again())
    window.close()
    return pictures, asked


@pytest.mark.parametrize(
    ("for_good", "first", "step"),
    [
        pytest.param(False, 0, 5, id="once"),
        pytest.param(True, 1, 7, id="for good"),
        pytest.param(False, 1, 2, id="once, others", marks=pytest.mark.guards("drawing")),
        *(
            pytest.param(True, first, 4, id=f"for good, {first}", marks=pytest.mark.guards("drawing"))
            for first in (0, 2, 3)
        ),
    ],
)
def test_any_request_may_fail(
    graphics: GraphicsContext,
    scene: Scene,
    packs: tuple[Pack, Pack],
    truth: tuple[dict[str, NDArray[np.uint8]], int],
    for_good: bool,
    first: int,
    step: int,
) -> None:
    """Request `first`, and every `step` later."""
    pictures, requests = truth
    before = existing(graphics)
    for number in range(first, requests, step):
        memory = FailingMemory(graphics.gl, number, for_good)
        window = opened(graphics, memory, scene, packs)
        window.run()
        assert memory.asked > number
        assert_equal(window.seen, pictures)
        if window.renderer is not None:
            memory.generous = True
            assert_equal(window.draw_again(), pictures)
            if window.seen.keys() != VIEWS.keys():
                window.reopen_pack()
                assert window.draw_again().keys() == VIEWS.keys()
                assert_equal(window.seen, pictures)
        window.close()
        assert memory.objects_given == 0, number
        assert existing(graphics) == before, number


def test_latents_have_what_memory_there_is(graphics: GraphicsContext, scene: Scene, packs: tuple[Pack, Pack]) -> None:
    class NoMoreLatents(GpuMemory):
        """No large buffer of latents."""

        most = 512

        def allows(self, what: str, size: int) -> bool:
            return what != "latents" or size <= self.most

    memory = NoMoreLatents(graphics.gl, PLENTY)
    renderer = Renderer(replace(graphics, memory=memory), scene)
    renderer.set_packs({"p": packs[0]})
    frame = renderer.render(replace(VIEWS["forward"], size=(200, 120)))
    assert frame.short_latents
    used = renderer.memory(FORWARD)
    assert used is not None
    assert used.parts["latents"] <= memory.most
    memory.most = 16
    renderer.set_packs({})
    renderer.set_packs({"p": packs[1]})
    with pytest.raises(GpuMemoryError, match="pack p: latents: the GPU has no memory"):
        renderer.render(VIEWS["forward"])
    renderer.release()
    assert memory.objects_given == 0


def test_without_the_reference_packs_are_shown(
    graphics: GraphicsContext, scene: Scene, packs: tuple[Pack, Pack]
) -> None:
    memory = ForgetfulMemory(graphics.gl, "source images")
    window = opened(graphics, memory, scene, packs)
    window.run()
    assert set(window.seen) == {name for name in VIEWS if "reference" not in name}
    assert all(line.startswith("the reference: ") and "source images of" in line for line in window.refusals)
    window.close()


def test_a_picture_that_is_too_large_leaves_the_one_before(graphics: GraphicsContext, scene: Scene) -> None:
    context = replace(graphics, memory=GpuMemory(graphics.gl, PLENTY))
    renderer = Renderer(context, scene)
    frame = renderer.render(VIEWS["reference"])
    before = read_picture(frame.image)
    most = int(graphics.gl.info["GL_MAX_TEXTURE_SIZE"])
    with pytest.raises(GpuMemoryError, match=f"{most + 1} x 8 is more than the {most} .*GL_MAX_TEXTURE_SIZE"):
        renderer.render(replace(VIEWS["reference"], size=(most + 1, 8)))
    np.testing.assert_array_equal(read_picture(frame.image), before)
    np.testing.assert_array_equal(read_picture(renderer.render(VIEWS["reference"]).image), before)
    renderer.release()
    assert context.memory.objects_given == 0


def test_auto_takes_a_path_that_there_is_memory_for(
    graphics: GraphicsContext, scene: Scene, packs: tuple[Pack, Pack], truth: tuple[dict[str, NDArray[np.uint8]], int]
) -> None:
    memory = ForgetfulMemory(graphics.gl, "latents")
    renderer = Renderer(replace(graphics, memory=memory), scene, tile_cache=TILES)
    renderer.set_packs({"p": packs[0]})
    view = replace(VIEWS["forward"], slot_a=Slot("p", "auto"))
    with pytest.raises(GpuMemoryError, match="pack p: latents"):
        renderer.render(view)
    memory.word = "decoded tiles"
    frame = renderer.render(view)
    assert frame.paths[view.slot_a] != "cached"
    assert np.abs(read_picture(frame.image).astype(int) - truth[0]["forward"]).max() <= ONE_STEP
    renderer.release()
    assert memory.objects_given == 0


def test_images_out_of_sight_make_room(graphics: GraphicsContext, scene: Scene) -> None:
    memory = ForgetfulMemory(graphics.gl, "nothing yet")
    renderer = Renderer(replace(graphics, memory=memory), scene)
    whole = read_picture(renderer.render(VIEWS["reference"]).image)
    held = memory.objects_given
    # Images of one size are one array: the second is refused while another one is there.
    reference = renderer.images.of("reference", "base").uploads
    places = reference._places
    sizes = {plan.size for plan in places.plans.values()}
    assert len(sizes) > 1

    def allows(what: str, _size: int) -> bool:
        return "source images" not in what or not reference.arrays

    array = next(iter(reference.arrays))
    materials = [index for index in range(len(scene.materials)) if places.of([index])]
    material = next(index for index in materials if {place.array for place in places.of([index])} == {array})
    reference._drop(array)
    memory.allows = allows  # type: ignore[method-assign, assignment]
    step = Step(Budget.WHOLE, is_same_view=False, is_stale=False)
    reference.advance([material], reference, step)
    assert set(reference.arrays) == {array}
    others = [index for index in materials if index != material]
    with pytest.raises(GpuMemoryError):
        reference.advance([material, *others], reference, step)
    del memory.allows
    renderer._scheduler.invalidate(reference)
    renderer.render(replace(VIEWS["reference"], size=LARGER))
    np.testing.assert_array_equal(read_picture(renderer.render(VIEWS["reference"]).image), whole)
    assert memory.objects_given == held
    renderer.release()
