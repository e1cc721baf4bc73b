"""The site: equal folders give equal bytes, and what an earlier site left is removed.

The file ``MARK`` names every file of a site. Nothing else in the output folder is touched. While a site is written, it
names the files of both, the earlier and the new one, so that the same command goes on after an interruption.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import pandas as pd

from ...core.errors import StorageError, UserError, reason
from ...core.io import TEMPORARY, read_text, write_atomically
from ...study.running import provenance
from ..compare.paired import read_run
from ..data.layout import CALIBRATED, CATEGORIES, FLOOR, ONLINE, OPEN_LOOP, ORACLE, Layout, network_of
from ..data.results import Results
from ..data.tables import GUARDED, MOST_BYTES, clusters_in, records_text, score_columns
from ..page import asset
from .html import page, slug
from .pages import Study, about, cards, places
from .pictures import figures

MARK = "files-of-the-site.txt"


def write_site(given: Sequence[Path], output: Path) -> tuple[int, list[Path]]:
    """Write the site over folders of reports; return how many there are, and the folders beside them without any.

    given: reports, or folders of reports. UserError: a file of a report is damaged or missing, or the output holds
    anything else than a site. Nothing is written then.
    """
    reports, without = _folders(given)
    earlier = _earlier(output, reports)
    studies = dict[str, Study]()
    for folder in reports:  # those of one name are numbered
        name, count = slug(folder.resolve().name), 1
        while name in studies:
            count += 1
            name = f"{slug(folder.resolve().name)}-{count}"
        studies[name] = _study(folder, name)
    contents = dict(_contents([*studies.values()], without))
    _write_mark(output, {*contents, *earlier})
    for name, content in contents.items():
        write_atomically(output / name, content)
    _remove(output, earlier - set(contents))
    _write_mark(output, set(contents))
    return len(studies), without


def _folders(given: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """The folders of reports, and those beside them that hold none. UserError: no report in one of those given."""
    found: dict[Path, Path] = {}
    without: list[Path] = []
    for folder in given:
        if not folder.is_dir():
            raise UserError(f"{folder}: no such folder; expected a report, or a folder of reports")
        below = sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))
        reports = [folder] if _is_report(folder) else [path for path in below if _is_report(path)]
        if not reports:
            raise UserError(f"{folder}: no report in it; expected records.csv, here or a level below")
        without += [path for path in below if path not in reports and reports != [folder]]
        found |= {path.resolve(): path for path in reports if path.resolve() not in found}
    return list(found.values()), without


def _is_report(folder: Path) -> bool:
    return any((folder / name).exists() for name in ("records.csv", provenance.FILE))


def _study(folder: Path, slugged: str) -> Study:
    """Read a report for its page. UserError: one of its files is missing or damaged."""
    run, name = read_run(folder), folder.resolve().name
    if not run.provenance:
        raise UserError(f"{folder / provenance.FILE}: missing; run the study again")
    try:
        frame = run.records
        drawn = json.loads(read_text(folder / "board.json", MOST_BYTES))
        table = pd.read_csv(io.StringIO(records_text(folder / "table.csv")), dtype=str, keep_default_na=False)
        networks = table["parameters"].map(lambda text: network_of(json.loads(text or "{}")))
        displays = frame.loc[(frame["condition"] == frame["display"]) & (frame["category"] != FLOOR), "condition"]
        nominal = frame[(frame["category"] == FLOOR) | frame["condition"].isin(displays)].reset_index(drop=True)
        shown = nominal[nominal["category"] != FLOOR]
        by_category = {each: frozenset(shown.loc[shown["category"] == each, "label"]) for each in CATEGORIES}
        learned = shown.loc[shown["learned_sha256"] != "", "label"] if "learned_sha256" in shown else ()
        layout = Layout(
            title=name,
            pairs=tuple(dict.fromkeys(zip(shown["label"], shown["condition"], strict=True))),
            targets=tuple(dict.fromkeys(nominal["target"])),
            headline=drawn["headline"]["key"],
            baseline=drawn["baseline"],
            privileged=by_category[ORACLE],
            trained=by_category[CALIBRATED] | frozenset(learned),
            blind=by_category[OPEN_LOOP],
            camera=by_category[ONLINE],
            identities=frozenset(table.loc[networks == "identity", "label"].replace(GUARDED, r"\1", regex=True)),
            measure=str(nominal["measure"].iloc[0]),
            clusters=clusters_in(nominal),
            study=name,
        )
        results = Results(nominal, layout)
        if layout.measure != "error_budget":  # which is made of further scores than those that a site shows
            kept = {score.column for score in (results.headline, *results.beside)}
            results = replace(results, frame=nominal.drop(columns=[*{*score_columns(nominal)} - kept]))
        changed = frame["condition"].nunique() - nominal["condition"].nunique()
        pictures = figures(folder, results.conditions, slugged)
        study = Study(name, results, run.provenance, str(drawn["question"]), changed, slugged, *pictures)
        if not study.boards:
            raise UserError("no row of an unchanged display in records.csv")
    except Exception as error:  # whatever a damaged file leads to
        raise UserError(f"{folder}: {reason(error)}; mend its files, or write the report again") from error
    return study


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


def _contents(found: Sequence[Study], without: Sequence[Path]) -> Iterator[tuple[str, bytes]]:
    """(path below the site, bytes) of every file."""
    names = sorted({name for study in found for name in study.results.names.values()})
    displays, methods = cards(found), {name: rows for name in names if (rows := places(found, name))}
    yield "assets/page.css", asset("page.css").encode()
    yield "assets/site.css", (files(__package__) / "assets" / "site.css").read_bytes()
    values: dict[str, Any] = {"displays": displays, "studies": found, "methods": methods, "without": without}
    title = "Which phase-retrieval method, on which display?"
    yield "index.html", page("index", up="", title=title, about=about, **values)
    for name, own in displays.items():
        headed = [(each.of.name, each) for each in own]
        sheets = next((each.sheets for each in own if each.sheets), [])
        values = {"about": own[0].about, "boards": headed, "pictures": sheets, "notes": "", "facts": []}
        yield f"displays/{slug(name)}.html", page("boards", title=f"Display {name}", **values)
    for name, rows in methods.items():
        yield f"methods/{slug(name)}.html", page("method", title=name, about=about(name), places=rows)
    for study in found:
        shown = [picture.path for each in study.boards for picture in each.pictures]
        values = {
            "about": study.question,
            "boards": [(each.title, each) for each in study.boards],
            "pictures": [picture for picture in study.figures if picture.path not in shown],
            "notes": study.notes,
            "facts": study.facts,
        }
        yield f"studies/{study.slug}.html", page("boards", title=study.name, **values)
        yield from ((picture.path, picture.content) for picture in (*study.figures, *study.sheets))
