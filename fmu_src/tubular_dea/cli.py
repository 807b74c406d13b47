"""The command `tubular-dea`: one subcommand a module in `commands`, errors in one line."""

from __future__ import annotations

import argparse
import io
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from . import __version__
from .commands import COMMANDS, declare
from .errors import ArgumentError, ColumnError, SeveralErrors, UserError

OPTIONS = {"parameters": "set", "settings": "set", "cases": "compare", "tube": "model"}  # arguments called otherwise
FILES = (".html", ".toml")  # endings of an --out that is one file, not a folder


class Parser(argparse.ArgumentParser):
    """A parser that reports a mistake in one line and points to the help."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._negative_number_matcher = re.compile(r"-\.?\d")  # -5kV is a value, too
        self.register("type", int, whole_number)  # int and float themselves would say "invalid int value"
        self.register("type", float, number)

    def error(self, message: str) -> NoReturn:
        """One line to stderr, and exit with 2."""
        print(f"{self.prog}: {printable(message)}; see {self.prog} --help", file=sys.stderr)
        sys.exit(2)


def whole_number(text: str) -> int:
    """What every option of `type=int` reads."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a whole number but was given {text!r}") from None


def number(text: str) -> float:
    """What every option of `type=float` reads."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number but was given {text!r}") from None


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; 0 on success, 2 where the user has something to correct, 130 when interrupted."""
    given = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal that has no sign for +- shows another one
            stream.reconfigure(errors="replace")
    parser = Parser(
        prog="tubular-dea",
        description="A tubular dielectric elastomer actuator as a co-simulation unit.",
        epilog='example:\n  tubular-dea simulate --pressure "95 mmHg" --voltage "step 0 5 kV at 1" --stop 3 --out run',
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"tubular-dea {__version__}")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    options = argparse.Namespace(command=given[0])
    try:
        # Only the command in use is imported, which may take a second: help and errors come at once.
        for name, description in COMMANDS.items():
            form = argparse.RawDescriptionHelpFormatter
            subparser = subparsers.add_parser(name, help=description, formatter_class=form)
            if name in given[:1]:
                declare(name, subparser)
        options, left = parser.parse_known_args(given)
        if left:
            subparsers.choices[options.command].error(f"unrecognized arguments: {' '.join(left)}")
        if getattr(options, "out", None) is not None:
            usual = subparsers.choices[options.command].get_default("out")
            is_file = named_file(options.out, usual) if usual is not None else False
            writable_folder(options.out, is_file or options.out.suffix in FILES)
        options.run(options)
    except UserError as problem:
        print(f"tubular-dea {options.command}: {printable(as_option(problem, options))}", file=sys.stderr)
        return 2
    except OSError as problem:  # errors that no other function has explained
        words = f"{problem.filename}: {problem.strerror}" if problem.filename else problem.strerror or str(problem)
        print(f"tubular-dea {options.command}: {printable(words)}", file=sys.stderr)
        return 2
    except MemoryError:
        print(f"tubular-dea {options.command}: out of memory; ask for less, or free some", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"tubular-dea {options.command}: interrupted", file=sys.stderr)
        return 130
    return 0


def as_option(problem: UserError, options: argparse.Namespace) -> str:
    """The error, with the option in the place of the argument that it is about."""
    if isinstance(problem, SeveralErrors):
        return problem.each(lambda one: as_option(one, options))
    if isinstance(problem, ColumnError):
        return problem.as_option() if hasattr(options, "columns") else problem.in_bench_file()
    if not isinstance(problem, ArgumentError):
        return str(problem)
    name = OPTIONS.get(problem.argument, problem.argument)
    return f"--{name.replace('_', '-')}{problem.text}" if hasattr(options, name) else str(problem)


def named_file(out: Path, usual: Path) -> bool:
    """Whether a command writes one file, as `usual` is; `UserError` where --out is not the name of such a one."""
    if usual.suffix not in FILES:
        return False
    what = "page" if usual.suffix == ".html" else "file"
    if out.suffix != usual.suffix:
        raise UserError(f"--out {out}: expected the name of a {what} that ends in {usual.suffix}, as in {usual}")
    if out.is_dir():
        raise UserError(f"--out {out}: expected the name of a {what}, as in {usual}, but it is a folder")
    return True


def writable_folder(out: Path, is_file: bool = False) -> None:
    """`UserError` where --out, or what holds it if it is a file, cannot become a folder to write to; nothing is created
    yet."""
    for one in (out, *out.absolute().parents):
        if one.is_symlink() and not one.exists():
            raise UserError(f"--out {out}: {one} is a link to {one.readlink()}, which is not there; give another name")
    folder = out.parent if is_file else out
    existing = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    if not existing.is_dir():
        raise UserError(f"--out {out}: expected a folder but {existing} is a file; give another name")
    if not os.access(existing, os.W_OK | os.X_OK) or existing.is_relative_to("/proc"):
        raise UserError(f"--out {out}: {existing} cannot be written to; give another folder")


def printable(text: str, longest: int = 2000) -> str:
    """A message that may quote a file: control characters spelled out, what is too long cut in the middle."""
    shown = "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in text)
    half = longest // 2
    return shown if len(shown) <= longest else f"{shown[:half]} [...] {shown[-half:]}"


if __name__ == "__main__":
    sys.exit(main())
