"""Effects of commands that are carried out at once, for sessions that no frame is drawn of."""

import time

from viewer.app.effects import Effects
from viewer.app.opening import Opening
from viewer.commands.effects import Effect

SECONDS = 60.0


def finish_opening(opening: Opening) -> None:
    """Open all that waits, as if frames had shown it."""
    began = time.monotonic()
    while opening.is_under_way:
        opening.note_shown()
        opening.advance()
        assert time.monotonic() - began < SECONDS
        time.sleep(0.001)


class PromptEffects(Effects):
    """What a command asks to be opened is open when it has run."""

    def perform(self, effect: Effect) -> None:
        super().perform(effect)
        finish_opening(self.opening)
