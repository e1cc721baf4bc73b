"""``holoeval solve``: one picture, one display, a few methods; a study that is written, run and reported at once."""

from __future__ import annotations

import itertools
import re
import shutil
from collections.abc import Iterable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
import yaml

from ..core.errors import UserError
from ..core.io import file_name
from .options import ARTIFACTS, PANEL, RESULTS, RETRAIN, Learned

STUDY, ARCHIVE = "study.yaml", "study.zip"  # in the output folder; the archive has all that the study wrote
MOST = 10  # files that are left for a picture: phases and captures of more methods are in the archive alone


def solve(
    methods: Annotated[str, typer.Argument(help="A method, or several with commas between: names, or mine.py:solve.")],
    picture: Annotated[Path, typer.Argument(help="An 8-bit RGB or gray image.")],
    display: Annotated[str, typer.Option(help="A display profile: its name or its file.")] = "leto-2020",
    panel: Annotated[tuple[int, int] | None, PANEL] = None,
    output: Annotated[
        Path | None, typer.Option(help="Output folder. [default: holoeval-results/<name of the picture>]")
    ] = None,
    values: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="A parameter: training.rounds=1 of each method, wirtinger.iterations=50 of that label.",
        ),
    ] = None,
    artifacts: Learned = ARTIFACTS,
    retrain: Annotated[bool, RETRAIN] = False,
) -> None:
    """Let methods solve one picture: phases, captures, scores and a picture of all side by side."""
    from ..datasets.images import decode, read
    from ..display import load_profile
    from ..study.config import load_study
    from ..study.plan import plan
    from .run import INTERRUPTED, run

    names = [name.strip() for name in methods.split(",") if name.strip()]
    if not picture.is_file() and Path(methods).is_file():
        raise UserError(f"{picture}: no such file; the picture comes second: holoeval solve METHODS {methods}")
    decode(read(picture), str(picture), gray=True)  # what is wrong with it is said of the file that was named
    size = panel or load_profile(display).usual
    study_in = partial(_study, _entries(names, values or []), picture, display, size)
    # named like the picture, the first without a number
    numbered = (RESULTS / f"{picture.stem}{f'-{number}' * (number > 1)}" for number in itertools.count(1))
    folder = output or next(folder for folder in numbered if _is_free(folder, picture, study_in(folder)))
    is_new, config, work = not folder.exists(), folder / STUDY, _work(folder)
    _copy(picture, folder)
    if not _is_free(folder, picture, study_in(folder)):
        raise UserError(f"{folder}: holds the work of other methods, parameters or displays; choose another --output")
    config.write_text(study_in(folder), encoding="utf-8")
    try:
        study = load_study(config)
        spec = plan(study).tasks[0].conditions[0].spec
        gray = " and shown in gray, by the one wavelength of the display" * (len(spec.wavelengths) == 1)
        optics = "{} x {} pixels".format(*spec.shape)
        optics += f", {1e3 * spec.distance:.4g} mm from its image" * (spec.plane == "fresnel")
        print(
            f"{picture} on {display}, a panel of {optics}; the picture is cropped to the aspect of what is scored{gray}"
        )
        if (folder / ARCHIVE).is_file() and not work.exists():
            with suppress(Exception):  # what is damaged is computed again
                shutil.unpack_archive(folder / ARCHIVE, work)
        run(config, output=work, executor="serial", artifacts=artifacts, retrain=retrain)
    except UserError as error:
        if is_new and not (work / "records").exists():
            shutil.rmtree(folder)
            shutil.rmtree(work, ignore_errors=True)
        raise UserError(re.sub(rf"^{re.escape(str(config))}(:\d+)*: ", "", str(error))) from None
    except typer.Exit as left:  # cells have failed, whose records stay in the folder of work
        if left.exit_code != INTERRUPTED:
            _leave(work, folder, study.labels)
        raise
    _leave(work, folder, study.labels)
    shutil.make_archive(str((folder / ARCHIVE).with_suffix("")), "zip", work)
    shutil.rmtree(work)
    print(f"{folder / ARCHIVE}: all else, such as records, details and exact phases")


def _work(folder: Path) -> Path:
    """Where the study of an output folder is computed, until it is whole: beside it, so that all share phases."""
    return folder.parent / f".{folder.name or 'solve'}"


def _leave(work: Path, folder: Path, labels: Iterable[str]) -> None:
    """Copy what a user wants of a study into the output folder, and print it."""
    files = {name: work / name for name in ("report.html", "table.csv")}
    files["pictures.jpg"] = work / "figures" / "answer-pictures.jpg"
    for what in ("phases", "captures"):
        found = {label: sorted((work / what / label).rglob("*.png")) for label in map(file_name, labels)}
        if len(files) + sum(map(len, found.values())) <= MOST - 3:  # beside the config, the picture and the archive
            for label, own in found.items():
                files |= {f"{what}/{label}{f'-{n}' * (len(own) > 1)}.png": file for n, file in enumerate(own, 1)}
    for name, file in files.items():
        if file.is_file():
            (folder / name).parent.mkdir(exist_ok=True)
            shutil.copyfile(file, folder / name)
            print(folder / name)


def _is_free(folder: Path, picture: Path, study: str) -> bool:
    """Whether a folder holds no report, or that of this study of this picture."""
    config, copy = folder / STUDY, folder / "picture" / picture.name
    if not (folder / ARCHIVE).exists() and not _work(folder).exists():
        return True
    if not (config.is_file() and copy.is_file()):
        return False
    return config.read_text(encoding="utf-8") == study and copy.read_bytes() == picture.read_bytes()


def _copy(picture: Path, folder: Path) -> None:
    """Copy a picture into a folder. UserError for one whose name is not of a picture, and where other files are."""
    from ..datasets.images import SUFFIXES, read

    content = read(picture)
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


def _entries(names: list[str], values: list[str]) -> list[Any]:
    """The methods of a config, with parameters that are ``key=value``: of the method that the key begins with, or of
    each. UserError for a text that is no such value."""
    from ..core.yaml_source import Document
    from ..study import isolation
    from ..study.changes import with_value

    def is_parameter(word: str) -> bool:
        told = (isolation.words(name, Path()).parameters for name in names)
        return any(each.name.partition(".")[0] == word for parameters in told for each in parameters)

    document = Document("", "", {"methods": [{"name": name, "params": {}} for name in names]}, {}, {})
    for text in values:
        document = with_value(document, text, is_parameter, of_each=True)
    entries = [{**entry, "name": _absolute(entry["name"])} for entry in document.data["methods"]]
    return [entry if entry["params"] else entry["name"] for entry in entries]


def _study(methods: list[Any], picture: Path, display: str, panel: tuple[int, int], folder: Path) -> str:
    """The study of a picture that lies in a folder."""
    from ..core.installed import shipped_configs
    from ..core.pictures import open_picture
    from ..datasets.images import read

    gray = {"gray": True} if open_picture(read(picture)).channels == 1 else {}
    profile = str(Path(display).resolve()) if Path(display).is_file() else display
    table3 = yaml.safe_load(shipped_configs()["table3"].read_bytes())  # whose trained methods serve here, too
    study = {
        "title": f"{picture.name} on {display}",
        "seed": table3["seed"],
        "display": {"profiles": [profile], "panel": list(panel)},
        "targets": {"dataset": "folder", "params": {"path": str(folder / "picture"), **gray}},
        "training": table3["training"],
        "methods": methods,
        "save": {"captures": True, "phases": True},
    }
    return yaml.safe_dump(study, sort_keys=False)


def _absolute(method: str) -> str:
    """The name of a method; of one in a file with the whole path, since the config lies in another folder."""
    file, colon, name = method.rpartition(":")
    return f"{Path(file).resolve()}{colon}{name}" if file.endswith(".py") else method
