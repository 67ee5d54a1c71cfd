"""The one exception that bad input raises."""


class InputError(Exception):
    """Bad input. The message is one line naming the file, the field and the remedy; the CLI prints it and exits 2.

    What a terminal would act on (escape sequences in names that a hostile file chose) is shown as a question mark.
    """

    def __init__(self, message: str) -> None:
        line = " ".join(message.split())
        super().__init__("".join(letter if letter.isprintable() else "?" for letter in line))
