"""The site: equal folders give equal bytes, and what an earlier site left is removed.

The file ``MARK`` names every file of a site. Nothing else in the output folder is touched. While a site is written, it
names the files of both, the earlier and the new one, so that the same command goes on after an interruption.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from importlib.resources import files
from pathlib import Path

from ...core.errors import StorageError, UserError
from ...core.io import TEMPORARY, write_atomically
from .checks import folded
from .html import page, slug
from .intake import Source, folders, read
from .pages import Study, about, cards, facts, places, slugs
from .pictures import figures, sheet, thumbnails

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
    studies = [_study(source, name) for source, name in zip(sources, slugs(sources), strict=True)]
    yield "assets/page.css", (files("holobench_eval.report.page") / "assets" / "page.css").read_bytes()
    yield "assets/site.css", (files(__package__) / "assets" / "site.css").read_bytes()
    shown, methods = (
        cards(studies),
        dict.fromkeys(row for study in studies for row in study.source.results.names.values()),
    )
    found = [(title, slug(title), own) for title, own in shown.items()]
    yield (
        "index.html",
        page(
            "index",
            title="Which phase-retrieval method, on which display?",
            displays=[
                {
                    "title": title,
                    "slug": name,
                    "about": own[0]["about"],
                    "verdict": own[0]["verdict"],
                    "pictures": own[0]["pictures"],
                }
                for title, name, own in found
            ],
            studies=[
                {"slug": each.slug, "name": each.source.name, "whose": each.whose, "question": each.question}
                for each in studies
            ],
            methods=[{"name": name, "about": about(name)} for name in sorted(methods) if not name.startswith("floor_")],
            without=without,
        ),
    )
    for title, name, own in found:
        sheets = [each["sheet"] for each in own if each["sheet"]][:1]
        text = page("display", 1, title=f"Display {title}", about=own[0]["about"], boards=own, sheets=sheets)
        yield f"displays/{name}.html", text
    for method in methods:
        pictures = [placed for study in studies for placed in study.thumbnails if placed[1].of == method]
        if found_places := places(studies, method):
            text = page("method", 1, title=method, about=about(method), places=found_places, pictures=pictures)
            yield f"methods/{slug(method)}.html", text
    for study in studies:
        yield f"studies/{study.slug}.html", _study_page(study)
        placed = (*study.figures, *study.thumbnails, *study.sheets.values())
        yield from ((path, picture.content) for path, picture in placed)


def _study(source: Source, name: str) -> Study:
    taken, count = figures(source)
    sheets = {display: drawn for display in source.results.conditions if (drawn := sheet(source, display))}
    return Study(
        source,
        name,
        [(f"pictures/{name}/{picture.name}", picture) for picture in taken],
        [(f"pictures/{name}/{picture.name}", picture) for picture in thumbnails(source)],
        count - len(taken),
        {display: (f"pictures/{name}/{picture.name}", picture) for display, picture in sheets.items()},
    )


def _study_page(study: Study) -> bytes:
    source = study.source
    notes = [f"{study.left} more figures are in its folder."] if study.left else []
    notes += [f"{source.changed} conditions are changes of a display, and not shown."] if source.changed else []
    return page(
        "study",
        1,
        title=f"{source.name}{study.whose}",
        question=study.question,
        boards=study.boards,
        pictures=study.figures,
        notes=" ".join(notes),
        facts=facts(source),
    )
