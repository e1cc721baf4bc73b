"""``holoeval check``: whether committed reports still follow from their studies, and from their methods."""

from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...core.errors import CellError, UserError, one_line
from ...core.installed import as_typed
from ...core.panels import is_small
from ...core.parts import divided
from ..options import Learned
from .rerun import rerun

if TYPE_CHECKING:
    from ...study.definition import Study

NEEDED = ("records.csv", "table.csv")
SAMPLE = 24  # kept captures of a report that are scored again
SAME = 1e-3  # of a score, or in its unit: more than processors and libraries differ on one capture


def check(
    folder: Annotated[Path, typer.Argument(help="A report, or a folder of reports.")] = Path("reports"),
    rerun_cells: Annotated[
        int, typer.Option("--rerun", min=0, metavar="N", help="Solve, capture and score N cells of each report again.")
    ] = 0,
    seed: Annotated[int, typer.Option(help="Which kept captures and which cells for --rerun are drawn.")] = 0,
    artifacts: Learned = Path("artifacts"),
) -> None:
    """Check that reports still follow from their records.

    Kept captures are scored again; with --rerun, methods solve again, too.
    """
    reports, problems = problems_in(folder)
    problems += kept_in(folder, seed)
    if rerun_cells:
        problems += rerun_in(folder, rerun_cells, seed, artifacts)
    for problem in problems:
        print(one_line(problem))
    for line in _earlier(folder):
        print(one_line(line))
    print(f"{reports} report{'s' * (reports > 1)}, {len(problems)} problem{'s' * (len(problems) != 1)}")
    if problems:
        raise typer.Exit(1)


def problems_in(folder: Path) -> tuple[int, list[str]]:
    """Number of reports (``reports_in``), and a line for all that no longer holds. UserError: no reports."""
    from ...study.running import provenance

    reports = reports_in(folder)
    if not reports:
        raise UserError(f"{folder}: no report, and none in its folders (looked for {provenance.FILE})")
    return len(reports), [f"{report}: {problem}" for report in reports for problem in _problems(report)]


def kept_in(folder: Path, seed: int) -> list[str]:
    """Score a sample again of the captures that ``reports_in`` have kept; print of how many, and return a line for each
    whose record, or whose row of records.csv, has another score."""
    from ...core.seeds import seed as seed_of
    from ...report import read_records, records_text
    from ...report.results import score_columns
    from ...report.scores import parse
    from ...study.plan import plan
    from ...study.scoring.job import Job, Setting
    from ...study.scoring.picture import verified
    from ...study.store import Store

    faults = list[str]()
    for report, store in ((report, Store(report)) for report in reports_in(folder)):
        if not any(store.folder.glob("*.npy")):
            continue
        try:
            study, _ = finished(report)
            tasks, frame = plan(study).tasks, read_records(records_text(report / "records.csv"))
        except (UserError, OSError):  # which is among the problems
            continue
        names = {name: parse(name).key for name in score_columns(frame)}
        rows = frame.drop_duplicates("cell").set_index("cell")[[*names]].rename(columns=names).to_dict("index")
        setting = Setting(study, report, Path(), {}, threads=1, workers=1, device="cpu")
        pairs = ((task, *pair) for task in tasks for pair in zip(task.cells, task.conditions, strict=True))
        kept = [each for each in pairs if store.capture(each[1].id).is_file()]
        chosen = sorted(kept, key=lambda each: seed_of("check", seed, each[1].id))[:SAMPLE]
        print(f"{report}: {len(chosen)} of {len(kept)} kept captures scored again")
        for task, cell, display in chosen:
            where = f"{report}: {task.label} on {cell.condition}, {cell.target}"
            try:
                if (record := store.read(cell.id)) is None:
                    continue
                again = verified(Job(task, frozenset(), setting, alone=True), cell, display, record)
            except (UserError, CellError) as error:
                faults.append(f"{where}: {error}")
                continue
            for name, values in ((f"records/{cell.id}.json", record.values()), ("records.csv", rows.get(cell.id, {}))):
                told = {key: float(values[key]) for key in again if key in values}
                other = next((key for key in told if not math.isclose(told[key], again[key], abs_tol=SAME)), "")
                if other:
                    faults.append(
                        f"{where}: {other} is {told[other]:g} in {name}, and {again[other]:g} of the kept capture"
                    )
                    break
    return faults


def _earlier(folder: Path) -> Iterator[str]:
    """A line for each other version of the protocol by which reports were scored; they stand as they are."""
    from ...metrics.protocol import VERSION as PROTOCOL
    from ...study.identity import parted
    from ...study.running import provenance

    versions = Counter[str]()
    for report in reports_in(folder):
        with suppress(UserError):  # what is wrong with its provenance is a problem already
            scores = provenance.read(report).get("scores")
            versions.update(
                {parted(str(scored))[0] for scored in (scores if isinstance(scores, dict) else {}).values()}
            )
    for version, count in sorted(versions.items()):
        if version != PROTOCOL:
            yield (
                f"{count} report{'s' * (count > 1)} of scores by metric protocol {version}, as their pages say; now it "
                f"is {PROTOCOL}, by which the next 'holoeval run' of their studies scores"
            )


def _problems(report: Path) -> Iterator[str]:
    try:
        yield from _changes(report, *finished(report))
    except (UserError, OSError) as error:
        yield str(error)


def _changes(report: Path, study: Study, known: dict[str, Any]) -> Iterator[str]:
    """What is different from when the report was made, of which its provenance is ``known``."""
    from ...report import difference, facts_of, read_records, recompute_files, records_text
    from ...study.displays import displays
    from ...study.identity import parted, versions
    from ...study.plan import plan
    from ...study.running.provenance import text_digest

    for display in displays(study).values():
        now = {"version": display.version, "sha256": display.digest}
        then = dict(known["profiles"]).get(display.name)
        if then != now:
            yield f"profile '{display.name}' was {then}, is now {now}; run the study again"
    for name, version in dict(known["scores"]).items():
        if name not in versions() or parted(version)[1] != parted(versions()[name])[1]:
            yield f"'{name}' was of version {version}, is now of {versions().get(name)}; score its captures again"
    records = records_text(report / "records.csv")
    if differs := difference(read_records(records), plan(study)):
        yield f"{differs}: the study or the code has changed; run the study again"
        return
    command = f"run: holoeval report {shlex.quote(as_typed(study.config))} --output {shlex.quote(str(report))}"
    said_anew = text_digest(study.text) != known["config_sha256"]
    if said_anew:
        yield f"the text of the config has changed, but no cell; {command} (computes nothing)"
    for name in ("report.md", "details.md"):
        if not (report / name).is_file():
            yield f"{name} is missing; {command}"
    files = recompute_files(records, facts_of(study))
    if said_anew:
        del files["board.json"]  # which has the title and the question
    for name, again in files.items():
        text = (report / name).read_text(encoding="utf-8") if (report / name).is_file() else None
        if text is None:
            yield f"{name} is missing; {command}"
        elif again.partition("\n")[0] != text.partition("\n")[0]:
            yield f"{name} has the columns of another version; {command}"
        elif again != text:
            yield f"{name} does not follow from records.csv; {command}"


def reports_in(folder: Path) -> list[Path]:
    """The reports of studies in a folder, or the folder itself where it is one, and those of their parts."""
    from ...study.running import provenance

    below = ("", "*/") if (folder / provenance.FILE).is_file() else ("*/", "*/*/")
    return sorted(path.parent for place in below for path in folder.glob(f"{place}{provenance.FILE}"))


def finished(report: Path) -> tuple[Study, dict[str, Any]]:
    """The study of a report and its provenance. UserError: the report is not finished, or what of it is missing."""
    from ...study.changes import recorded
    from ...study.config import load_study
    from ...study.running import provenance

    known = provenance.read(report)
    lacking = [key for key in ("config", "config_sha256", "profiles", "scores") if key not in known]
    if lacking:
        raise UserError(f"{provenance.FILE} lacks {', '.join(lacking)}")
    config = report / str(known["config"])
    if "ended" in known and known["ended"] is None:
        file, part = divided(config)
        again = f"'holoeval run {Path(file.name, part)}' goes on with it"
        raise UserError(f"a run into this folder is in progress, or was stopped before its end; {again}")
    missing = [name for name in NEEDED if not (report / name).is_file()]
    if missing:
        raise UserError(f"{' and '.join(missing)} missing; 'holoeval report' on its config writes them")
    return load_study(config, recorded(known)), known


def rerun_in(folder: Path, count: int, seed: int, artifacts: Path) -> list[str]:
    """Rerun ``count`` cells of each of ``reports_in``; print what was found, and return a line a fault."""
    from ...study.executors import executor

    faults = []
    for report in reports_in(folder):
        try:
            study, _ = finished(report)
            where = executor("auto", None, is_small(study.display.panel))
            verdict = rerun(report, study, count, seed, artifacts, where)
        except (UserError, OSError) as error:
            print(f"{report}: not rerun: {error}")
            continue
        for line in (str(verdict), *verdict.notes):
            print(f"{report}: {line}")
        faults += [" ".join(f"{report}: {fault}".split()) for fault in verdict.faults]
    return faults
