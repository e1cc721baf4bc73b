"""``holoeval session export`` and ``session import``: files exchanged with a bench that other software drives."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import Config
from .output import console, write_report

if TYPE_CHECKING:
    from ..study.folders.session import Advance

session = typer.Typer(
    help="Exchange files with a bench that other software drives.", no_args_is_help=True, rich_markup_mode=None
)

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="The session's folder.")]


@session.command("export")
def export(
    config: Config,
    folder: Folder,
    bench: Annotated[Path | None, typer.Option(help="File of the bench that will show the patterns.")] = None,
    display: Annotated[str | None, typer.Option(help="Without --bench: the study's display to stand for it.")] = None,
    fixed_exposure: Annotated[bool, typer.Option("--fixed-exposure", help="One exposure time for all.")] = False,
    dark: Annotated[
        str | None, typer.Option(metavar="FILE|LEVEL", help="Counts without light, in the place of dark frames.")
    ] = None,
) -> None:
    """Write the patterns of a study: what to show, in which order, and under which names to save photographs."""
    from ..study.folders.session import export as begin
    from ..study.running.progress import watching

    with watching(console()) as watch:
        advance = begin(config, folder, watch, bench, display, fixed_exposure, dark)
    _finish(advance, folder)


@session.command("import")
def import_(
    folder: Folder,
    study: Annotated[Path | None, typer.Option(help="The study's config, where the folder's copy may not do.")] = None,
) -> None:
    """Check the photographs in a session's folder, score them, and write the next round where a method needs one."""
    from ..study.folders.session import go_on
    from ..study.running.progress import watching

    with watching(console()) as watch:
        advance = go_on(folder, watch, print, study)
    _finish(advance, folder)


def _finish(advance: Advance, folder: Path) -> None:
    """Name the photographs to take next; where there are none, write the report."""
    from ..lab.session import read_manifest
    from ..study.folders.session import REPORT

    records = advance.outcome.records
    if not advance.patterns:
        write_report(console(), advance.study, records, folder / REPORT, advance.outcome.provenance)
        raise typer.Exit(1 if advance.outcome.failed else 0)
    number = advance.patterns[0].round
    print(f"{sum(record['state'] == 'done' for record in records)} of {len(records)} cells are scored")
    readme = f"{folder}/patterns/round-{number}/README.txt"
    if number == 1:
        print(f"to check the bench first: {folder}/patterns/checks/README.txt")
        if line := read_manifest(folder).phase.out_of_reach:
            print(line)
    print(f"round {number}: {len(advance.patterns)} patterns to photograph, see {readme}")
