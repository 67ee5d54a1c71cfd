"""Playing a script: a generator that yields whenever it waits for a frame or for time to pass, so that it blocks nothing."""

from collections.abc import Iterator

from ntc.errors import InputError
from viewer.script.parse import Script
from viewer.script.stage import Stage, Turn
from viewer.state.event_handlers import notify


def play_script(script: Script, stage: Stage) -> Iterator[Turn]:
    """Play `script` on `stage`: yields for every frame, and while it waits; ends with the script, or when a command closes the window.

    Raises InputError, with file and line, where a line cannot be carried out or its expectation fails, and where the
    window tells of an error that the next line does not expect.
    """
    for step, following in zip(script, (*script[1:], None), strict=True):
        known = _errors(stage)
        try:
            yield from step.play(stage)
        except InputError as error:
            if following is None or not following.expects_message:
                raise InputError(f"{step.where}: {error}") from error
            notify(stage.session, str(error), "error")
            yield "frame"
        new = [text for text in _errors(stage) if text not in known]
        if new and not (following is not None and following.expects_message):
            raise InputError(f"{step.where}: {new[0]}")
        if stage.is_closing:
            return


def _errors(stage: Stage) -> list[str]:
    return [toast.text for toast in stage.session.window.toasts if toast.kind == "error"]
