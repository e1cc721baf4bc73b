"""Options that several commands have, and what follows where they are left out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.errors import UserError, suggest
from ..core.panels import is_small
from ..core.shipped import shipped_configs

if TYPE_CHECKING:
    from ..study.definition import Study


def config_path(text: str) -> Path:
    """The config of a study, given by its path or by the name of one that ships. UserError for a name of none."""
    path = Path(text)
    shipped = shipped_configs()
    if path.is_file() or path.suffix or len(path.parts) > 1:
        return path
    if text not in shipped:
        raise UserError(f"no study of the name '{text}' ships, and no such file is here; {suggest(text, shipped)}")
    return shipped[text]


Config = Annotated[
    Path,
    typer.Argument(metavar="CONFIG", parser=config_path, help="A study: its file, or the name of one that ships."),
]
Output = Annotated[Path | None, typer.Option(help="Output folder. [default: holoeval-results/<name of the config>]")]
RESULTS = Path("holoeval-results")
Threads = Annotated[int | None, typer.Option(min=1, help="Torch threads of a worker.")]
Device = Annotated[str, typer.Option(help="Where torch computes: cpu, cuda, cuda:N, or auto, a GPU if it finds one.")]
Learned = Annotated[Path, typer.Option(help="Folder of what trained methods learned.")]
Profile = Annotated[str, typer.Argument(help="A display profile: its name or its file.")]


def output_folder(study: Study, output: Path | None) -> Path:
    """The folder that a study's records and report are written to."""
    return output or RESULTS / study.name


def thread_count(threads: int | None, workers: int, study: Study) -> int:
    """Torch threads of a worker: as asked for, else one, or all for a single worker on large panels."""
    import torch

    return threads or (1 if workers > 1 or is_small(study.display.panel) else torch.get_num_threads())
