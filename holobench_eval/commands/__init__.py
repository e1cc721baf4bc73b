"""The command line: ``holoeval COMMAND``, a command a file. Heavy libraries are imported inside functions."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from io import TextIOWrapper

import typer

from ..core.errors import UserError

# In the order of the help. Each is a file in this folder; its last name is that of the function, or group of functions,
# in it.
COMMANDS = (
    "score",
    "doctor",
    "bench",
    "run",
    "solve",
    "plan",
    "report",
    "list_",
    "new_method",
    "check",
    "reports.compare",
    "reports.site",
    "show",
    "conformance",
    "calibrate",
    "session",
)

app = typer.Typer(
    name="holoeval",
    help="Compare phase-retrieval methods for holographic displays on simulated, imperfect benches.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for _file in COMMANDS:
    _function = _file.rpartition(".")[2]
    _name = _function.rstrip("_").replace("_", "-")
    _command: Callable[..., None] | typer.Typer = getattr(import_module(f".{_file}", __name__), _function)
    if isinstance(_command, typer.Typer):
        app.add_typer(_command, name=_name)
    else:
        app.command(_name)(_command)


def main() -> None:
    """Run the command line; bad input and files that cannot be used are one line on stderr and exit code 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # names and signs that a terminal of another encoding lacks
    try:
        app()
    except (UserError, OSError) as error:
        print(f"holoeval: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(2)
