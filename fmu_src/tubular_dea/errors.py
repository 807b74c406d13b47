"""Errors that the user can correct: their text says what was expected, what came and what to do."""

import shlex
from collections.abc import Iterable


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


class ReadError(UserError, ValueError):
    """A file that cannot be read; the text names file, line and column, what was expected and what came."""


class ColumnError(ReadError):
    """A column that is missing or unclear, with what helps where it is read.

    `problem` is followed by what may be said in Python, as an option or in a file, so that `column` is the `signal`;
    or, where nothing can be said, by what else helps (`otherwise`).
    """

    def __init__(self, problem: str, signal: str, column: str | int, otherwise: str) -> None:
        super().__init__(problem, signal, column, otherwise)
        self.problem, self.signal, self.column, self.otherwise = problem, signal, column, otherwise

    def __str__(self) -> str:
        column = self.column if isinstance(self.column, int) else f'"{self.column}"'
        return f'{self.problem} columns={{"{self.signal}": {column}}} in read_recordings'

    def as_option(self) -> str:
        """For a command that has --columns."""
        return f"{self.problem} --columns {shlex.quote(f'{self.signal}={self.column}')}"

    def in_bench_file(self) -> str:
        """For a command that has not."""
        return f'{self.problem} {self.signal} = "{self.column}" below [columns] in the folder\'s bench.toml'


def list_of_names(argument: str, given: Iterable[str]) -> list[str]:
    """The names in a list; `ArgumentError` for one alone, which would be taken letter by letter, and for no names."""
    if isinstance(given, str):
        raise ArgumentError(argument, f": expected a list, as [{given!r}], but was given {given!r} alone")
    names = list(given) if isinstance(given, Iterable) else [given]
    if not all(isinstance(name, str) for name in names):
        raise ArgumentError(argument, f": expected a list of names but was given {given!r}")
    return names
