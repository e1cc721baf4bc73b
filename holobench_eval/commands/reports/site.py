"""``holoeval site``: many reports as one static site with a leaderboard."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def site(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(metavar="DIR...", help="Reports, or folders of reports. [default: reports]"),
    ] = None,
    output: Annotated[Path, typer.Option(metavar="FOLDER", help="Where the site is written.")] = Path("site"),
) -> None:
    """Write a static site over many reports: a leaderboard, and a page a method, a display and a study."""
    from ...report.site import write_site

    count, without = write_site(folders or [Path("reports")], output)
    for folder in without:
        print(f"{folder}: no records.csv, left out")
    print(f"{output / 'index.html'}: {count} stud{'ies' if count > 1 else 'y'}")
