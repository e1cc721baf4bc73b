"""The site: equal folders give equal bytes, and what an earlier site left is removed.

The file ``MARK`` names every file of a site. Nothing else in the output folder is touched. While a site is written, it
names the files of both, the earlier and the new one, so that the same command goes on after an interruption.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.resources import files
from pathlib import Path

from ...core.errors import StorageError, UserError
from ...core.io import TEMPORARY, write_atomically
from ..charts.style import slugs as stems
from .board import Names
from .checks import folded
from .displays import Display
from .html import SCRIPTS, colours, slug
from .index import index
from .intake import Source, folders, read
from .pages import Shown, display_page, method_page, study_page
from .pictures import Picture, figures, sheet, thumbnails
from .standing import Group, groups

MARK = "files-of-the-site.txt"


def write_site(given: Sequence[Path], output: Path, own: Path) -> tuple[int, list[Path]]:
    """Write the site over folders of reports; return how many there are, and the folders beside them without any.

    given: reports, or folders of reports; own: the folder below which reports are own ones. UserError: a folder that
    does not pass the checks, or an output that holds anything else than a site. Nothing is written then.
    """
    found, without = folders(given)
    earlier = _earlier(output, found)
    sources = [read(folder, own) for folder in found]
    _check_names(sources)
    contents = _whole(_contents(sources, without))
    _write_mark(output, {*contents, *earlier})
    for name, content in contents.items():
        write_atomically(output / name, content)
    _remove(output, earlier - set(contents))
    _write_mark(output, set(contents))
    return len(sources), without


def _earlier(output: Path, found: Sequence[Path]) -> set[str]:
    """The files that an earlier site left in the output folder. UserError: it holds anything else."""
    if output.is_symlink() or (output.exists() and not output.is_dir()):
        raise UserError(f"--output {output}: not a folder; expected a new one, or that of an earlier site")
    mark, present = output / MARK, set[str]()
    listed = set(mark.read_text("utf-8", "replace").splitlines()) if mark.is_file() and not mark.is_symlink() else set()
    for folder, inside, names in os.walk(output):
        for path in (Path(folder, name) for name in sorted((*inside, *names))):
            name = path.relative_to(output).as_posix()
            known = name in listed or name == MARK or path.name.startswith(TEMPORARY)
            if path.is_symlink() or not (path.is_dir() or known):
                raise UserError(
                    f"--output {output}: holds {name!r}, which is no file of a site; expected a new folder, or an "
                    "earlier site and nothing else"
                )
            if not path.is_dir():
                present.add(name)
    for report in found:
        if output.resolve().is_relative_to(report.resolve()) or report.resolve().is_relative_to(output.resolve()):
            raise UserError(f"--output {output}: overlaps with {report}; expected another folder")
    return present - {MARK}


def _write_mark(output: Path, names: set[str]) -> None:
    write_atomically(output / MARK, "".join(f"{name}\n" for name in sorted(names)).encode())


def _remove(output: Path, names: set[str]) -> None:
    """Remove files of an earlier site, and the folders that are empty then."""
    try:
        for name in sorted(names):
            (output / name).unlink()
        for path in sorted(output.rglob("*"), reverse=True):
            if path.is_dir() and not any(path.iterdir()):
                path.rmdir()
    except OSError as error:
        reason = f"{error.filename} cannot be removed: {error.strerror}; mend that, and run the same command again"
        raise StorageError(reason) from error


def _check_names(sources: Sequence[Source]) -> None:
    """UserError: two labs whose names differ by case or space alone."""
    found: dict[str, Source] = {}
    for source in sources:
        other = found.setdefault(folded(source.by), source)
        if other.by != source.by:
            raise UserError(f"{source.folder}: by {source.by!r}, but {other.by!r} in {other.folder}; expected one name")


def _whole(contents: Iterable[tuple[str, bytes]]) -> dict[str, bytes]:
    """Every file by its path. UserError: two of one path."""
    found: dict[str, bytes] = {}
    for name, content in contents:
        if name in found:
            raise UserError(f"{name}: two files of the site would have this name; give their originals other names")
        found[name] = content
    return found


def _contents(sources: Sequence[Source], without: Sequence[Path]) -> Iterator[tuple[str, bytes]]:
    """(path below the site, bytes) of every file."""
    standing, names = groups(sources), Names(_slugs(sources))
    yield from _assets()
    yield "index.html", index(standing, sources, without, names)
    shown = {source.folder: _shown(source) for source in sources}
    for source in sources:
        folder = names.studies[str(source.folder)]
        yield f"studies/{folder}.html", study_page(source, standing, names, shown[source.folder])
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
    start = f"comparison-{stems([display.name])[display.name]}-"
    return [
        (f"../pictures/{folder}/{picture.name}", picture)
        for picture in shown[source.folder].figures
        if picture.of.startswith(start) and picture.of.removeprefix(start).isdigit()
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
    yield "assets/site.css", (own / "site.css").read_bytes() + colours().encode()
    for name in SCRIPTS:
        yield f"assets/{name}", (own / name).read_bytes()
