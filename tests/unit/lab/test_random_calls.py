"""Random calls of the monkey: every command that can run now, with texts that it takes."""

import random
from pathlib import Path

from lab.window_trials.random_calls import LEFT_OUT, random_call
from viewer.commands import COMMANDS
from viewer.commands.command import Context
from viewer.locations import assets_folder
from viewer.scene.load import load_scene
from viewer.state.open_files import InitialView, new_session
from viewer.state.pack_files import open_packs, packs_beside
from viewer.state.settings import ViewerSettings


def test_every_possible_command_is_called_with_texts_that_it_takes() -> None:
    path = assets_folder() / "courtyard.glb"
    session = new_session(load_scene(path), open_packs(packs_beside(path)), ViewerSettings(), InitialView())
    context, source = Context(session), random.Random(1)
    possible = {command.id for command in COMMANDS if not command.why_not(context)} - LEFT_OUT
    called = set()
    for _ in range(40 * len(possible)):
        command, texts = random_call(context, [Path("a.glb")], source)
        command.parse(texts)
        called.add(command.id)
    assert called == possible
    assert random_call(context, [], source, "training.encode")[0].id == "training.encode"
    assert random_call(context, [], source, "training.pause")[0].id in possible
    # Packs of codec block are encoded anew, not trained.
    assert "training.retrain" not in called
    assert "training.anew" in called
