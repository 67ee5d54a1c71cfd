"""The one exception that bad input raises."""


class InputError(Exception):
    """Bad input. The message is one line naming the file, the field and the remedy; the CLI prints it and exits 2."""

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.split()))
