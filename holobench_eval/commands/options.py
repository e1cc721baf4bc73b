"""Options that several commands have, and what follows where they are left out."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.errors import UserError, suggest
from ..core.installed import clone, shipped_configs
from ..core.panels import is_small

if TYPE_CHECKING:
    from ..study.changes import Changes
    from ..study.definition import Study
    from ..study.plan import Plan


def config_path(text: str) -> Path:
    """The config of a study, given by its path or by the name of one that ships; a part of it is named behind either.

    UserError for a name of none.
    """
    path, shipped = Path(text), shipped_configs()
    name, *part = path.parts or ("",)
    if path.is_file() or any(Path(each).suffix for each in path.parts):
        return path
    if name not in shipped:
        fault = f"no study of the name '{name}' ships, and no such file is here; {suggest(name, shipped)}"
        raise UserError(f"{fault}; a part follows a name or a file, file.yaml/part" if part else fault)
    return shipped[name].joinpath(*part)


Config = Annotated[
    Path,
    typer.Argument(
        metavar="CONFIG",
        parser=config_path,
        help="A study: its file, or the name of one that ships; NAME/PART is a part of it.",
    ),
]
Output = Annotated[
    Path | None,
    typer.Option(help="Output folder. [default: holoeval-results/<name of the config>, or <name>-changed]"),
]
RESULTS = Path("holoeval-results")
PANEL = typer.Option(metavar="ROWS COLUMNS", help="Pixels of the simulated panel, at most all of it, such as 192 192.")
Threads = Annotated[int | None, typer.Option(min=1, help="Torch threads of a worker.")]
Device = Annotated[str, typer.Option(help="Where torch computes: cpu, cuda, cuda:N, or auto, a GPU if it finds one.")]
Learned = Annotated[Path, typer.Option(help="Folder of what trained methods learned.")]
ARTIFACTS = Path("artifacts")  # the default
Methods = Annotated[list[str] | None, typer.Option(metavar="A,B", help="Only these methods, by their labels or names.")]
Targets = Annotated[list[str] | None, typer.Option(metavar="X,Y", help="Only these targets.")]
RETRAIN = typer.Option("--retrain", help="Train again what the study's methods learn.")
Limit = Annotated[int | None, typer.Option(min=1, metavar="N", help="Only the first N targets.")]
Values = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="A value in the config, seed=7, or of a method, LABEL.step=0.1."),
]
Profile = Annotated[str, typer.Argument(help="A display profile: its name or its file.")]


def changes_of(
    methods: list[str] | None, targets: list[str] | None, limit: int | None, values: list[str] | None
) -> Changes:
    """What the options change in a config."""
    from ..study.changes import Changes

    return Changes(tuple(methods or ()), tuple(targets or ()), limit, tuple(values or ()))


def output_folder(study: Study, output: Path | None) -> Path:
    """The folder that a study's records and report are written to.

    A changed study has a folder of its own. UserError: the folder holds the report of the whole study.
    """
    from ..study.changes import recorded
    from ..study.running import provenance

    if not study.changes:
        return output or RESULTS / study.name
    folder = output or RESULTS / f"{study.name}-changed"
    if (known := provenance.read(folder)) and not recorded(known):
        raise UserError(
            f"{folder}: holds the report of a whole study, and this is a part of one; give another --output"
        )
    return folder


def studies(config: Path, output: Path | None, changes: Changes) -> list[tuple[Study, Path]]:
    """A study and its folder, and its parts behind it; a changed study alone."""
    from ..study.config import load_study

    first = load_study(config, changes)
    folder = output_folder(first, output)
    parts = [load_study(first.file / name) for name in ({} if changes else first.parts)]
    return [(first, folder), *((part, folder / part.part) for part in parts)]


def planned(config: Path, output: Path | None) -> Iterator[tuple[Study, Path, Plan]]:
    """A study as it was run into its folder, that folder, and the plan; then its parts that were run."""
    from ..study.changes import recorded
    from ..study.plan import plan
    from ..study.running import provenance

    changes = recorded(provenance.read(output)) if output else changes_of(None, None, None, None)
    for study, folder in studies(config, output, changes):
        if study.config == config or (folder / provenance.FILE).is_file():
            yield study, folder, plan(study)


def thread_count(threads: int | None, workers: int, study: Study) -> int:
    """Torch threads of a worker: as asked for, else one, or all for a single worker on large panels."""
    import torch

    return threads or (1 if workers > 1 or is_small(study.display.panel) else torch.get_num_threads())


def learned_folder(given: Path, grid: Plan) -> Path:
    """The folder of artifacts. Where the default is not there, that of the clone which this package runs from, if it
    has everything that a plan needs: nothing is trained into another folder than the working directory's."""
    from ..study.artifacts import Artifacts

    root, needed = clone(), grid.preparations().values()
    if given != ARTIFACTS or given.is_dir() or root is None:
        return given
    own = Artifacts(root / given)
    return own.folder if needed and all(own.has(preparation) for preparation in needed) else given
