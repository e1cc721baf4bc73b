"""The command line: ``holoeval COMMAND``, a command a file. Heavy libraries are imported inside functions."""

from __future__ import annotations

import codecs
import re
import sys
from collections.abc import Callable
from importlib import import_module
from io import TextIOWrapper
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from .. import __version__
from ..core.errors import UserError, one_line, out_of_memory

# By purpose and in the order of work, as the help lists them. Each is a file in this folder; its last name is that of
# the function, or group of functions, in it.
COMMANDS = {
    "A study": (
        "configs",
        "list_",
        "plan",
        "run",
        "rescore",
        "reports.report",
        "solve",
        "displays",
        "show",
        "schema",
    ),
    "Finished reports": ("reports.figure", "reports.check", "reports.compare", "reports.site"),
    "Pictures and real displays": ("doctor", "score", "session", "twin"),
    "Your own methods, displays and devices, and this program": (
        "own.new",
        "own.conformance",
    ),
}


def _name(file: str) -> str:
    """What a command is called by."""
    return file.rpartition(".")[2].rstrip("_").replace("_", "-")


class _ByPurpose(TyperGroup):
    """A help that lists the commands as ``COMMANDS`` does, a line each."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if args and args[0] in ("new-method", "new-display"):  # as it was called once
            args = ["new", args[0].removeprefix("new-"), *args[1:]]
        return super().parse_args(ctx, ["--version"] if "--version" in args else args)  # after a command, too

    def list_commands(self, ctx: Any) -> list[str]:
        return [_name(file) for files in COMMANDS.values() for file in files]

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        widest = max(map(len, self.commands))
        for purpose, files in COMMANDS.items():
            names = [_name(file) for file in files]
            with formatter.section(purpose):
                formatter.write_dl([(name.ljust(widest), _first_words(self.commands[name].help)) for name in names])


def _first_words(text: str | None) -> str:
    """A docstring up to its first full stop, colon or semicolon, as a sentence."""
    return re.split(r"[.:;](?=\s|$)", text or "", maxsplit=1)[0] + "."


app = typer.Typer(
    name="holoeval",
    cls=_ByPurpose,
    help="Compare phase-retrieval methods for holographic displays on simulated, imperfect benches.",
    epilog="holoeval COMMAND -h explains a command.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for _file in (file for files in COMMANDS.values() for file in files):
    _command: Callable[..., None] | typer.Typer = getattr(
        import_module(f".{_file}", __name__), _file.rpartition(".")[2]
    )
    if isinstance(_command, typer.Typer):
        app.add_typer(_command, name=_name(_file))
    else:
        app.command(_name(_file))(_command)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"holoeval {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version and exit.")
    ] = False,
) -> None:
    """Options of the program itself."""


# What stands for signs that a terminal of another encoding lacks; "?" for all others.
PLAIN_SIGNS = {"–": "-", "—": "-", "·": "-", "…": "...", "×": "x", "µ": "u", "μ": "u", "−": "-"}


def _plain(error: UnicodeError) -> tuple[str, int]:
    """An error handler of codecs: the next sign, in ASCII."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return PLAIN_SIGNS.get(error.object[error.start], "?"), error.start + 1


def _told(error: Exception) -> str:
    """An error with its place first, of a copy that where it goes."""
    place = (error.filename2 or error.filename) if isinstance(error, OSError) else None
    return f"{place}: {error.strerror}" if isinstance(error, OSError) and place and error.strerror else str(error)


def main() -> None:
    """Run the command line; bad input and files that cannot be used are one line on stderr and exit code 2."""
    codecs.register_error("plain", _plain)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="plain")
    try:
        app(prog_name="holoeval")  # however Python was started
    except (UserError, OSError) as error:
        print(f"holoeval: {one_line(_told(error))}", file=sys.stderr)
        sys.exit(2)
    except (MemoryError, RuntimeError) as error:
        if (looped := str(error).partition("Symlink loop from ")[2]).startswith("'"):  # as pathlib says it
            print(f"holoeval: {one_line(looped)}: a link that leads back to itself; expected a file", file=sys.stderr)
            sys.exit(2)
        if not out_of_memory(error):
            raise
        print("holoeval: out of memory; what is finished is kept, run the same command with more", file=sys.stderr)
        sys.exit(2)
