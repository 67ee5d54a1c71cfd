"""The stochastic filter in the window: switched by a command, gathered while the view rests, and then nothing is drawn."""

from dataclasses import replace

from tests.support.driven_app import DrivenApp
from viewer.commands import run
from viewer.render.resources.accumulator import SAMPLES
from viewer.state.navigation import turned


def samples(app: DrivenApp) -> list[int]:
    """Of the slots of the last picture."""
    last = app.frontend.picture.last
    assert last is not None
    return list(last.samples.values())


def test_a_view_at_rest_gathers_samples_and_rests(app: DrivenApp) -> None:
    app.rest()
    assert samples(app) == []
    run(app.context, "filter.texels", "stochastic")
    app.rest()
    assert samples(app) == [SAMPLES]
    drawn = app.frontend.picture.frames_drawn
    for _ in range(5):
        app.frame()
    assert app.frontend.picture.frames_drawn == drawn
    # A moved camera begins anew.
    app.session.view = replace(app.session.view, camera=turned(app.session.view.camera, 3.0))
    app.frame()
    assert samples(app)[0] < SAMPLES
    app.rest()
    assert samples(app) == [SAMPLES]
