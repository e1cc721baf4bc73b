"""``holoeval new-method``: a file that runs, and a test that passes."""

from __future__ import annotations

import importlib.util
import keyword
import re
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Annotated

import typer

from ...core.errors import UserError


def new_method(
    name: Annotated[str, typer.Argument(help="Lower-case words, such as my_method.")],
    folder: Annotated[Path, typer.Option(help="Where to write NAME.py and test_NAME.py.")] = Path(),
    camera: Annotated[bool, typer.Option("--camera", help="One that captures its own holograms.")] = False,
    trains: Annotated[bool, typer.Option("--trains", help="One that learns from captures first.")] = False,
) -> None:
    """Write a method that works, to be changed, and its test."""
    if camera and trains:
        raise UserError("--camera and --trains: each writes another method; choose one of them")
    method, test, source = write_method(name, folder, "camera" if camera else "trains" if trains else "method")
    print(
        f"{method}\n{test}\nnext: pytest {test} (in a clone of holobench_eval, after pip install -e '.[dev]'); "
        f"name it in a config as '{source}'"
    )


def write_method(name: str, folder: Path, kind: str = "method") -> tuple[Path, Path, str]:
    """Write ``NAME.py`` and ``test_NAME.py`` and return their paths and the method as a config names it.

    kind: a template of methods: "method", which knows the nominal optics alone, "camera" or "trains".
    UserError for a name that is no module name and for files that exist: nothing is ever overwritten.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        raise UserError(f"'{name}' is no name for a method; use lower-case words such as 'my_method'")
    if importlib.util.find_spec(name) is not None:
        raise UserError(f"'{name}' is the name of an installed module, which {name}.py would hide; choose another")
    cls = "".join(word.capitalize() for word in name.split("_"))
    words = {"name": name, "cls": cls, "title": name.replace("_", " ").capitalize()}
    texts = {}
    for file, template in ((f"{name}.py", f"{kind}.txt"), (f"test_{name}.py", "test_method.txt")):
        text = files(__package__).joinpath("templates", template).read_text(encoding="utf-8")
        texts[file] = Template(text).substitute(words)
    method, test = write_new(folder, texts)
    return method, test, f"{method}:{cls}"


def write_new(folder: Path, texts: Mapping[str, str]) -> list[Path]:
    """Write files of a person's own, by their names in a folder; nothing is ever overwritten.

    UserError for files that exist, and for a folder that cannot be written.
    """
    paths = [folder / name for name in texts]
    for path in paths:
        if path.exists():
            raise UserError(f"{path} exists already; choose another name or --folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path, text in zip(paths, texts.values(), strict=True):
            path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UserError(f"{folder}: cannot be written: {error.strerror}; choose another --folder") from error
    return paths
