"""Errors that the user can correct: their text says what was expected, what came and what to do."""


class UserError(Exception):
    """Shown by the command line as one line, without a traceback."""


class ArgumentError(UserError, ValueError):
    """An argument that cannot be used.

    `argument` is its name in Python; the command line shows the option of that name in its place. `text` follows the
    name, as in ": expected a positive number".
    """

    def __init__(self, argument: str, text: str) -> None:
        super().__init__(argument, text)
        self.argument = argument
        self.text = text

    def __str__(self) -> str:
        return f"{self.argument}{self.text}"


class MissingError(ArgumentError):
    """An argument that is needed and was not given; `example` is a value that would do."""

    def __init__(self, argument: str, text: str, example: str) -> None:
        super().__init__(argument, text)
        self.args = (argument, text, example)
        self.example = example

    def __str__(self) -> str:
        return f'{super().__str__()}, as in {self.argument}="{self.example}"'
