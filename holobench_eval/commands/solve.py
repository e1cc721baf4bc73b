"""``holoeval solve``: one picture, one display, a few methods; a study that is written, run and reported at once."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Annotated

import typer
import yaml

from ..core.errors import UserError
from .options import ARTIFACTS, PANEL, RESULTS, RETRAIN, Learned

STUDY = "study.yaml"  # in the output folder


def solve(
    methods: Annotated[str, typer.Argument(help="A method, or several with commas between: names, or mine.py:solve.")],
    picture: Annotated[Path, typer.Argument(help="An 8-bit RGB or gray image.")],
    display: Annotated[str, typer.Option(help="A display profile: its name or its file.")] = "leto-2020",
    panel: Annotated[tuple[int, int], PANEL] = (256, 256),
    output: Annotated[
        Path | None, typer.Option(help="Output folder. [default: holoeval-results/<name of the picture>]")
    ] = None,
    artifacts: Learned = ARTIFACTS,
    retrain: Annotated[bool, RETRAIN] = False,
) -> None:
    """Let methods solve one picture: phases, captures, scores and a picture of all side by side."""
    from ..core.io import file_name
    from ..study.config import load_study
    from ..study.displays import displays
    from ..study.plan import plan
    from .run import run

    names = [name.strip() for name in methods.split(",") if name.strip()]
    if not picture.is_file() and Path(methods).is_file():
        raise UserError(f"{picture}: no such file; the picture comes second: holoeval solve METHODS {methods}")
    folder = output or RESULTS / picture.stem
    is_new, before = not folder.exists(), folder / STUDY
    earlier = before.read_bytes() if before.is_file() else None
    config = write_study(names, picture, display, panel, folder)
    size = f"{panel[0]} x {panel[1]} pixels"
    try:
        study = load_study(config)
        plan(study)
        print(f"{picture} on {display}, a panel of {size}; the picture is cropped to the aspect of what is scored")
        run(config, output=folder, executor="serial", artifacts=artifacts, retrain=retrain)
    except UserError as error:
        if earlier is not None:  # the report that is there is of this one
            config.write_bytes(earlier)
        elif is_new and not (folder / "records").exists():
            shutil.rmtree(folder)
        raise UserError(re.sub(rf"^{re.escape(str(config))}(:\d+)*: ", "", str(error))) from None
    labels = [file_name(label) for label in study.labels]
    made = {(label, file_name(shown.title)) for label in labels for shown in displays(study).values()}
    for path in (
        *sorted(folder.glob("figures/comparison-*.jpg")),
        *(folder / what / label for what in ("phases", "captures") for label in labels),
    ):
        print(path)
    for path in _earlier(folder, made):
        print(f"{path}: not of this run, whose methods or display are others; left as it was")


def _earlier(folder: Path, made: set[tuple[str, str]]) -> list[Path]:
    """The folders of phases and captures in a folder that are those of other methods or displays than were made."""
    found = sorted(path for what in ("phases", "captures") for path in folder.glob(f"{what}/*/*") if path.is_dir())
    return [path for path in found if (path.parent.name, path.name) not in made]


def write_study(methods: list[str], picture: Path, display: str, panel: tuple[int, int], folder: Path) -> Path:
    """Copy a picture into a folder and write the study of it there; the path of the config.

    UserError for a picture that is no such file, and for a folder that holds another picture or other files.
    """
    from ..core.installed import shipped_configs
    from ..core.pictures import open_picture
    from ..datasets.images import SUFFIXES, decode, read

    content = read(picture)
    decode(content, str(picture), gray=True)  # what is wrong with it is said of the file that was named
    if picture.suffix.lower() not in SUFFIXES or picture.name.startswith("."):
        raise UserError(
            f"{picture}: not a picture by its name; expected one that ends in {', '.join(sorted(SUFFIXES))}"
        )
    pictures = folder / "picture"
    same = (picture.name, content)
    if other := next((file.name for file in pictures.glob("*") if (file.name, file.read_bytes()) != same), None):
        raise UserError(f"{pictures}: holds another {other}; choose another --output")
    is_own = pictures.is_dir() or not folder.exists()
    if not is_own and not (folder.is_dir() and {path.name for path in folder.iterdir()} <= {"phases"}):
        raise UserError(f"{folder}: is not a folder of solve and not empty; choose another --output")
    pictures.mkdir(parents=True, exist_ok=True)
    if not (pictures / picture.name).exists() or not (pictures / picture.name).samefile(picture):
        shutil.copyfile(picture, pictures / picture.name)
    gray = {"gray": True} if open_picture(content).channels == 1 else {}
    profile = str(Path(display).resolve()) if Path(display).is_file() else display
    table3 = yaml.safe_load(shipped_configs()["table3"].read_bytes())  # whose trained methods serve here, too
    study = {
        "title": f"{picture.name} on {display}",
        "seed": table3["seed"],
        "display": {"profiles": [profile], "panel": list(panel)},
        "targets": {"dataset": "folder", "params": {"path": str(pictures), **gray}},
        "training": table3["training"],
        "methods": [_absolute(method.strip()) for method in methods],
        "save": {"captures": True, "phases": True},
    }
    config = folder / STUDY
    config.write_text(yaml.safe_dump(study, sort_keys=False), encoding="utf-8")
    return config


def _absolute(method: str) -> str:
    """The name of a method; of one in a file with the whole path, since the config lies in another folder."""
    file, colon, name = method.rpartition(":")
    return f"{Path(file).resolve()}{colon}{name}" if file.endswith(".py") else method
