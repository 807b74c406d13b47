"""Errors that the user can correct: their text says what was expected, what came and what to do."""

import json
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence


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

    `problem` is followed by what may be said in Python, as an option or in a file, so that these are the `columns` by
    signal; or, where nothing can be said, by what else helps (`otherwise`).
    """

    def __init__(self, problem: str, columns: Mapping[str, str | int], otherwise: str) -> None:
        super().__init__(problem, columns, otherwise)
        self.problem, self.columns, self.otherwise = problem, columns, otherwise

    def __str__(self) -> str:
        columns = [f'"{s}": {c if isinstance(c, int) else json.dumps(c)}' for s, c in self.columns.items()]
        return f"{self.problem} columns={{{', '.join(columns)}}} in read_recordings"

    def as_option(self) -> str:
        """For a command that has --columns."""
        return f"{self.problem} --columns {' '.join(shlex.quote(f'{s}={c}') for s, c in self.columns.items())}"

    def in_bench_file(self) -> str:
        """For a command that has not."""
        columns = " and ".join(f'{signal} = "{column}"' for signal, column in self.columns.items())
        return f"{self.problem} {columns} below [columns] in the folder's bench.toml"


class SeveralErrors(ReadError):
    """What is wrong with each of several files, of many with the first ones; `more` counts the others."""

    def __init__(self, errors: Sequence[ReadError], more: int = 0) -> None:
        super().__init__(errors, more)
        self.errors, self.more = errors, more

    def __str__(self) -> str:
        return self.each(str)

    def each(self, told: Callable[[ReadError], str]) -> str:
        """A line for every error, as it is `told`, and how many there are besides."""
        return "\n".join([*map(told, self.errors), *([f"and {self.more} more files"] if self.more > 0 else [])])


def list_of_names(argument: str, given: Iterable[str]) -> list[str]:
    """The names in a list; `ArgumentError` for one alone, which would be taken letter by letter, and for no names."""
    if isinstance(given, str):
        raise ArgumentError(argument, f": expected a list, as [{given!r}], but was given {given!r} alone")
    names = list(given) if isinstance(given, Iterable) else [given]
    if not all(isinstance(name, str) for name in names):
        raise ArgumentError(argument, f": expected a list of names but was given {given!r}")
    return names
