"""The exceptions of the codec library."""


class InputError(Exception):
    """Bad input. The message is one line naming the file, the field and the remedy; the CLI prints it and exits 2.

    Characters that a terminal would interpret (escape sequences in names from a hostile file) become question marks.
    """

    def __init__(self, message: str) -> None:
        line = " ".join(message.split())
        super().__init__("".join(letter if letter.isprintable() else "?" for letter in line))


class TrainingFailedError(InputError):
    """Loss or gradients were not finite several times in a row."""


class TrainingCancelledError(Exception):
    """The caller cancelled a training; there is no result."""


class NotFiniteError(Exception):
    """Loss or a gradient is NaN or infinite; the training step was not done."""


class MetadataError(Exception):
    """An error in the metadata of a pack; the message names the field."""


class FormerFormatError(MetadataError):
    """The pack has a format of its codec that is no longer read; the message names it."""


class ProcessEndedError(Exception):
    """A worker process has ended. The message says how: `was killed by signal 9`."""
