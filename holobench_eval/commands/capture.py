"""The commands for real captures: ``holoeval session``, ``score`` and ``doctor``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .output import console, print_headline, write_report

if TYPE_CHECKING:
    from ..study.session import Advance

session = typer.Typer(
    help="Exchange files with a bench that other software drives.", no_args_is_help=True, rich_markup_mode=None
)

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="The session's folder.")]


@session.command("export")
def export(
    config: Annotated[Path, typer.Argument(metavar="STUDY", help="A study, such as configs/table3.yaml.")],
    folder: Folder,
    bench: Annotated[Path | None, typer.Option(help="File of the bench that will show the patterns.")] = None,
    display: Annotated[str | None, typer.Option(help="Without --bench: the study's display to stand for it.")] = None,
    fixed_exposure: Annotated[bool, typer.Option("--fixed-exposure", help="One exposure time for all.")] = False,
) -> None:
    """Write the patterns of a study: what to show, in which order, and under which names to save photographs."""
    from ..study.progress import watching
    from ..study.session import export as begin

    with watching(console()) as watch:
        advance = begin(config, folder, watch, 1, bench, display, fixed_exposure=fixed_exposure)
    _told(advance, folder)


@session.command("import")
def import_(
    folder: Folder,
    study: Annotated[Path | None, typer.Option(help="The study's config, where the folder's copy may not do.")] = None,
) -> None:
    """Check the photographs in a session's folder, score them, and write the next round where a method needs one."""
    from ..study.progress import watching
    from ..study.session import go_on

    with watching(console()) as watch:
        advance = go_on(folder, watch, 1, print, study)
    _told(advance, folder)


def _told(advance: Advance, folder: Path) -> None:
    """What comes next: photographs to take, or the report."""
    from ..study.session import REPORT

    if advance.patterns:
        number = advance.patterns[0].round
        done = sum(record["state"] == "done" for record in advance.outcome.records)
        print(f"{done} of {len(advance.outcome.records)} cells are scored")
        where = f"{folder}/patterns/round-{number}"
        print(f"round {number}: {len(advance.patterns)} patterns to photograph, see {where}/README.txt")
        return
    study, outcome = advance.study, advance.outcome
    write_report(console(), study, outcome.records, folder / REPORT, outcome.provenance)
    raise typer.Exit(1 if advance.outcome.failed else 0)


def score(
    captures: Annotated[Path, typer.Option(help="Folder with captures, METHOD/TARGET.png.")],
    targets: Annotated[Path, typer.Option(help="Folder with targets, TARGET.png.")],
    output: Annotated[Path, typer.Option(help="Where to write the report.")],
    values: Annotated[str, typer.Option(help="Values in the files: stored (as they are), srgb or linear.")] = "stored",
    baseline: Annotated[str | None, typer.Option(help="The method that others are tested against.")] = None,
    lpips_weights: Annotated[Path | None, typer.Option(help="File or folder of the LPIPS trunk.")] = None,
) -> None:
    """Score pictures that were taken long ago: align each with its target by what it shows, and write a report."""
    from .score_folders import score_folders

    weights = None if lpips_weights is None else str(lpips_weights)
    report, results = score_folders(captures, targets, output, values, baseline, weights, console())
    print_headline(console(), results)
    print(f"{report}\n{output / 'table.csv'}\n{output / 'records.csv'}")
    raise typer.Exit(1 if len(results.holes) else 0)


def doctor() -> None:
    """List what is installed, which panels and cameras answer, and what to do about each thing missing."""
    from .diagnosis import main

    raise typer.Exit(main())


def add_to(app: typer.Typer) -> None:
    """Make the commands part of the command line."""
    app.add_typer(session, name="session")
    app.command()(score)
    app.command()(doctor)
