"""``holoeval site``: many reports as one static site with a leaderboard."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def site(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(metavar="DIR...", help="Reports, or folders of reports. [default: that of --own]"),
    ] = None,
    output: Annotated[Path, typer.Option(metavar="FOLDER", help="Where the site is written.")] = Path("site"),
    own: Annotated[
        Path, typer.Option(metavar="DIR", help="Where own reports are; any other folder says whose it is.")
    ] = Path("reports"),
) -> None:
    """Write a static site over many reports: a leaderboard, and a page a method, a display and a study."""
    from ...report.site import write_site

    count, without = write_site(folders or [own], output, own)
    for folder in without:
        print(f"{folder}: no records.csv, left out")
    print(f"{output / 'index.html'}: {count} stud{'ies' if count > 1 else 'y'}")
