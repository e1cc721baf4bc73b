"""The site, written whole: equal folders give equal bytes, and what an earlier site left is removed."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from pathlib import Path

from ...core.errors import UserError
from ...core.io import write_atomically
from .board import Names
from .displays import Display
from .html import SCRIPTS, colours, slug
from .index import index
from .intake import Source, folders, read
from .pages import Shown, display_page, method_page, study_page
from .pictures import Picture, figures, sheet, thumbnails
from .standing import Group, groups

MARK = "assets/site.css"  # a folder with this file is a site, and may be written again
PARTS = ("assets", "displays", "methods", "pictures", "studies")


def write_site(given: Sequence[Path], output: Path) -> tuple[int, list[Path]]:
    """Write the site over folders of reports; return how many there are, and the folders beside them without any.

    given: reports, or folders of reports. UserError: a folder that does not pass the checks, or an output that would
    overwrite something else. Nothing is written then.
    """
    found, without = folders(given)
    _check_output(output, found)
    sources = [read(folder) for folder in found]
    contents = dict(_contents(sources, without, output))
    for part in PARTS:
        shutil.rmtree(output / part, ignore_errors=True)
    for name, content in contents.items():
        write_atomically(output / name, content)
    return len(sources), without


def _check_output(output: Path, found: Sequence[Path]) -> None:
    if output.is_symlink() or (output.exists() and not output.is_dir()):
        raise UserError(f"--output {output}: not a folder; expected a new one, or that of an earlier site")
    if output.is_dir() and any(output.iterdir()) and not (output / MARK).is_file():
        raise UserError(
            f"--output {output}: holds something that is no site; expected a new folder, or an earlier site"
        )
    for folder in found:
        if output.resolve().is_relative_to(folder.resolve()) or folder.resolve().is_relative_to(output.resolve()):
            raise UserError(f"--output {output}: overlaps with {folder}; expected another folder")


def _contents(sources: Sequence[Source], without: Sequence[Path], output: Path) -> Iterator[tuple[str, bytes]]:
    """(path below the site, bytes) of every file."""
    standing, names = groups(sources), Names(_slugs(sources))
    yield from _assets()
    yield "index.html", index(standing, sources, without, names)
    shown = {source.folder: _shown(source) for source in sources}
    for source in sources:
        folder = names.studies[str(source.folder)]
        yield f"studies/{folder}.html", study_page(source, standing, names, shown[source.folder], output)
        for picture in (*shown[source.folder].figures, *shown[source.folder].thumbnails):
            yield f"pictures/{folder}/{picture.name}", picture.content
    for method in dict.fromkeys(row.method for group in standing for row in group.rows):
        pictures = [
            (f"../pictures/{names.studies[str(source.folder)]}/{picture.name}", picture)
            for source in sources
            for picture in shown[source.folder].thumbnails
            if picture.of == method
        ]
        yield f"methods/{slug(method)}.html", method_page(method, standing, names, pictures)
    for display in {group.display.title: group.display for group in standing}.values():
        yield from _display(display, standing, names, shown)


def _display(
    display: Display, standing: Sequence[Group], names: Names, shown: Mapping[Path, Shown]
) -> Iterator[tuple[str, bytes]]:
    """The page of a display, its stage sheet, and the pictures of its newest study."""
    own = [group for group in standing if group.display.title == display.title]
    sources = list({row.source.folder: row.source for group in own for row in group.rows}.values())
    drawn = next((each for source in sources if (each := sheet(source, display.name))), None)
    if drawn is not None:
        yield f"pictures/displays/{slug(display.title)}.png", drawn.content
    pictures = next((found for source in sources if (found := _of(display, source, shown, names))), [])
    yield f"displays/{slug(display.title)}.html", display_page(display, standing, names, drawn, pictures)


def _of(display: Display, source: Source, shown: Mapping[Path, Shown], names: Names) -> list[tuple[str, Picture]]:
    """The first comparisons of a study on a display."""
    folder = names.studies[str(source.folder)]
    start = f"comparison-{slug(display.name.replace(' ', '-'))}-"
    return [
        (f"../pictures/{folder}/{picture.name}", picture)
        for picture in shown[source.folder].figures
        if picture.name.removeprefix(start).partition(".")[0].isdigit() and picture.name.startswith(start)
    ][:1]


def _shown(source: Source) -> Shown:
    taken, count = figures(source)
    return Shown(taken, thumbnails(source), count)


def _slugs(sources: Sequence[Source]) -> dict[str, str]:
    """The name of each study's page, by folder; folders of one name are numbered."""
    found: dict[str, str] = {}
    for source in sources:
        name, number = slug(source.name), 1
        while name in found.values() or name == "displays":
            number += 1
            name = f"{slug(source.name)}-{number}"
        found[str(source.folder)] = name
    return found


def _assets() -> Iterator[tuple[str, bytes]]:
    own, of_page = files(__package__) / "assets", files("holobench_eval.report.page") / "assets"
    yield "assets/page.css", (of_page / "page.css").read_bytes()
    yield MARK, (own / "site.css").read_bytes() + colours().encode()
    for name in SCRIPTS:
        yield f"assets/{name}", (own / name).read_bytes()
