"""Options that several commands have, and what follows where they are left out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.errors import UserError

if TYPE_CHECKING:
    from ..study.changes import Changes
    from ..study.definition import Study

Config = Annotated[Path, typer.Argument(metavar="CONFIG", help="A study, such as configs/table3.yaml.")]
Output = Annotated[
    Path | None,
    typer.Option(help="Output folder. [default: reports/<name of the config>, of a changed one with -changed]"),
]
Threads = Annotated[int | None, typer.Option(min=1, help="Torch threads of a worker.")]
Device = Annotated[str, typer.Option(help="Where torch computes: cpu, cuda, cuda:N, or auto, a GPU if it finds one.")]
Learned = Annotated[Path, typer.Option(help="Folder of what trained methods learned.")]
Methods = Annotated[list[str] | None, typer.Option(metavar="A,B", help="Only these methods, by their labels or names.")]
Targets = Annotated[list[str] | None, typer.Option(metavar="X,Y", help="Only these targets.")]
Limit = Annotated[int | None, typer.Option(min=1, metavar="N", help="Only the first N targets.")]
Values = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Another value in the config: display.panel=[192, 192]."),
]
Profile = Annotated[str, typer.Argument(help="A display profile: its name or its file.")]

LARGE_PANEL = 512 * 1024  # pixels


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
    from ..study import provenance
    from ..study.changes import recorded

    if not study.changes:
        return output or Path("reports") / study.name
    folder = output or Path("reports") / f"{study.name}-changed"
    if (known := provenance.read(folder)) and not recorded(known):
        raise UserError(
            f"{folder}: holds the report of a whole study, and this is a part of one; give another --output"
        )
    return folder


def is_small(panel: tuple[int, int] | None) -> bool:
    """Whether one thread computes a panel of (rows, columns) as well as several; not for one of unknown size."""
    return panel is not None and panel[0] * panel[1] < LARGE_PANEL


def thread_count(threads: int | None, workers: int, study: Study) -> int:
    """Torch threads of a worker: as asked for, else one, or all for a single worker on large panels.

    Transforms of small panels gain less than twofold from a second thread, and lose tenfold and more (measured) when
    another program wants the core, since the threads wait for each other after every operation.
    """
    import torch

    return threads or (1 if workers > 1 or is_small(study.display.panel) else torch.get_num_threads())
