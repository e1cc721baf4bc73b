"""``holoeval new``: a method, camera or panel that works, with its test, or a display with every key explained."""

from __future__ import annotations

import importlib.util
import json
import keyword
import re
import textwrap
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Annotated, Literal

import typer

from ...core.errors import UserError

Kind = Literal["method", "display", "camera", "panel"]

STARTS_AS = "ideal"  # whose panel the file has until it is changed
FIRST = "sampling"  # of the keys that a display may leave out
HEAD = """\
# A display of your own. It starts with the panel of '{base}': put in the values of your data sheet, lengths in metres,
# and take the '#' off what else your display has. docs/displays.md says more of displays.
#     holoeval list {file}       what it says
#     holoeval show {file}       what it does to a hologram, stage by stage
# In a study: display: {{profiles: [{file}], panel: [256, 256]}}
"""


def new(
    kind: Kind,
    name: Annotated[str, typer.Argument(help="Lower-case words, such as my_method; of a display my-display.")],
    folder: Annotated[Path, typer.Option(help="Where to write NAME.py and test_NAME.py, or NAME.yaml.")] = Path(),
    camera: Annotated[bool, typer.Option("--camera", help="A method that captures its own holograms.")] = False,
    trains: Annotated[bool, typer.Option("--trains", help="A method that learns from captures first.")] = False,
) -> None:
    """Write a method, display, camera or panel, to be changed: code that works and its test, or every key explained."""
    if camera + trains > (kind == "method"):
        raise UserError("--camera and --trains: each writes another method; choose one of them, of a method alone")
    if kind == "display":
        path = write_display(name.removesuffix(".yaml"), folder)
        print(f"{path}\nnext: change it; holoeval list {path}, holoeval show {path}")
        return
    template = kind if kind != "method" else "captures" if camera else "trains" if trains else "method"
    file, test, source = write_code(name.removesuffix(".py"), folder, template)
    print(f"{file}\n{test}\nnext: pytest {test} (in a clone of holobench_eval, after pip install -e '.[dev]')")
    key = {"camera": "camera: {driver: %s}", "panel": "slm: {driver: %s}"}.get(kind)
    print(f"holoeval doctor {source}; in a bench file {key % source}" if key else f"name it in a config as '{source}'")


def write_code(name: str, folder: Path, template: str = "method") -> tuple[Path, Path, str]:
    """Write ``NAME.py`` and ``test_NAME.py`` and return their paths and the class as a config names it.

    template: a method, "method", which knows the nominal optics alone, "captures" or "trains"; "camera" or "panel".
    UserError for a name that is no module name and for files that exist: nothing is ever overwritten.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        raise UserError(f"'{name}' is no name for a module; use lower-case words such as 'my_{template}'")
    if importlib.util.find_spec(name) is not None:
        raise UserError(f"'{name}' is the name of an installed module, which {name}.py would hide; choose another")
    cls = "".join(word.capitalize() for word in name.split("_"))
    words = {"name": name, "cls": cls, "title": name.replace("_", " ").capitalize()}
    texts = {}
    test = "test_device.txt" if template in ("camera", "panel") else "test_method.txt"
    for file, source in ((f"{name}.py", f"{template}.txt"), (f"test_{name}.py", test)):
        text = files(__package__).joinpath("templates", source).read_text(encoding="utf-8")
        texts[file] = Template(text).substitute(words)
    own, tested = write_new(folder, texts)
    return own, tested, f"{own}:{cls}"


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


def write_display(name: str, folder: Path) -> Path:
    """Write ``NAME.yaml``. UserError for a name that is none, or that of a display that ships."""
    from ...display.simulated.profile import names

    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name):
        raise UserError(f"'{name}' is no name for a display; use letters, digits, - and _, such as 'my-display'")
    if name in names():
        raise UserError(f"'{name}' is the name of a display that ships; choose another")
    return write_new(folder, {f"{name}.yaml": display_text(name)})[0]


def display_text(name: str) -> str:
    """The text of a new display's file: what it needs as values, all else as comments with their defaults."""
    from ...core.parameters import parameters
    from ...display import load_profile
    from ...display.simulated.profile import STAGES, Profile

    panel = vars(load_profile(STARTS_AS).panel)
    own = {"name": name, "version": 1, "seed": 0, "description": "A display of my own."}
    own |= {f"panel.{key}": value for key, value in panel.items()}
    lines = [HEAD.format(base=STARTS_AS, file=f"{name}.yaml")]
    for parameter in parameters(Profile):
        *owners, key = parameter.name.split(".")
        is_own = parameter.name in own or parameter.name == "panel"
        value = "" if parameter.default == "" or parameter.allowed.endswith("mapping of:") else f" {parameter.default}"
        value = f" {json.dumps(own[parameter.name])}" if parameter.name in own else value
        words = parameter.meaning or STAGES[key].model
        words += "" if parameter.allowed.endswith("mapping of:") else f" ({parameter.allowed})"
        block = [*(f"# {line}" for line in textwrap.wrap(words, 100)), f"{key}:{value}"]
        lines += ["", "# what is not ideal: take the '#' off"] * (parameter.name == FIRST)
        lines += [f"{'' if is_own else '# '}{'  ' * len(owners)}{line}" for line in block]
    return "\n".join(lines) + "\n"
