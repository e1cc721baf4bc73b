"""The site: equal folders give equal bytes, and what an earlier site left is removed.

The file ``MARK`` names every file of a site. Nothing else in the output folder is touched. While a site is written, it
names the files of both, the earlier and the new one, so that the same command goes on after an interruption.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from ...core.errors import StorageError, UserError
from ...core.io import TEMPORARY, write_atomically
from ..page.html import asset
from .html import page, slug
from .intake import Source, folded, folders, read
from .pages import about, cards, places, studies

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
    for path in sorted(output.rglob("*")):
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
    found = studies(sources)
    names = sorted({name for study in found for name in study.source.results.names.values()})
    displays, methods = cards(found), {name: rows for name in names if (rows := places(found, name))}
    yield "assets/page.css", asset("page.css").encode()
    yield "assets/site.css", (files(__package__) / "assets" / "site.css").read_bytes()
    values: dict[str, Any] = {"displays": displays, "studies": found, "methods": methods, "without": without}
    title = "Which phase-retrieval method, on which display?"
    yield "index.html", page("index", up="", title=title, about=about, **values)
    for name, own in displays.items():
        headed = [(f"{each.of.source.name}{each.of.whose}", each) for each in own]
        sheets = next((each.sheets for each in own if each.sheets), [])
        values = {"about": own[0].about, "boards": headed, "pictures": sheets, "notes": "", "facts": []}
        yield f"displays/{slug(name)}.html", page("boards", title=f"Display {name}", **values)
    for name, rows in methods.items():
        pictures = [picture for study in found for picture in study.thumbnails if picture.of == name]
        text = page("method", title=name, about=about(name), places=rows, pictures=pictures)
        yield f"methods/{slug(name)}.html", text
    for study in found:
        shown = [picture.path for each in study.boards for picture in each.pictures]
        values = {
            "about": study.question,
            "boards": [(each.title, each) for each in study.boards],
            "pictures": [picture for picture in study.figures if picture.path not in shown],
            "notes": study.notes,
            "facts": study.facts,
        }
        yield f"studies/{study.slug}.html", page("boards", title=f"{study.source.name}{study.whose}", **values)
        placed = (*study.figures, *study.thumbnails, *study.sheets)
        yield from ((picture.path, picture.content) for picture in placed)
