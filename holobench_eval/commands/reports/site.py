"""``holoeval site``: many reports as one page of cards."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def site(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(metavar="DIR...", help="Reports, or folders of reports. [default: reports]"),
    ] = None,
    output: Annotated[Path, typer.Option(metavar="FOLDER", help="Where index.html is written.")] = Path("site"),
) -> None:
    """Write one page over many reports: a card for each display of each study, with the best rows."""
    from ...report.site import write_site

    count, without = write_site(folders or [Path("reports")], output)
    for folder in without:
        print(f"{folder}: no records.csv, left out")
    print(f"{output / 'index.html'}: {count} stud{'ies' if count > 1 else 'y'}")
