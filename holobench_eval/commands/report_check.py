"""Are committed reports still what their studies say? Re-checked without computing a cell."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import UserError
from ..study import provenance
from ..study.config import load_study
from ..study.displays import displays

if TYPE_CHECKING:
    from ..study.definition import Study


def check(folder: Path) -> tuple[int, list[str]]:
    """Number of reports in a folder, and a line for everything that no longer holds."""
    from ..benchmarks import report as performance

    reports = sorted(path.parent for path in folder.glob(f"*/{provenance.FILE}"))
    timed = sorted(path.parent for path in folder.glob(f"*/{performance.MACHINE}"))
    if not reports and not timed:
        raise UserError(f"{folder}: no reports in this folder (looked for */{provenance.FILE})")
    problems = [f"{report}: {problem}" for report in reports for problem in _problems(report)]
    problems += [f"{report}: {problem}" for report in timed for problem in performance.problems(report)]
    return len(reports) + len(timed), problems


def _problems(report: Path) -> Iterator[str]:
    try:
        known = provenance.read(report)
        lacking = [key for key in ("config", "config_sha256", "profiles") if key not in known]
        if lacking:
            raise UserError(f"{provenance.FILE} lacks {', '.join(lacking)}")
        study = load_study(report / str(known["config"]))
        yield from _study_problems(study, known)
        yield from _table_problems(report, study)
    except (UserError, OSError) as error:
        yield str(error)


def _study_problems(study: Study, known: dict[str, Any]) -> Iterator[str]:
    if hashlib.sha256(study.text.encode()).hexdigest() != known["config_sha256"]:
        yield "the config has changed since the report was made; run the study again"
    for place in displays(study).values():
        now = {"version": place.version, "sha256": place.digest}
        then = dict(known["profiles"]).get(place.name)
        if then != now:
            yield f"profile '{place.name}' was {then}, is now {now}; run the study again"


def _table_problems(report: Path, study: Study) -> Iterator[str]:
    from ..report import layout_of, recompute_table

    again = recompute_table((report / "records.csv").read_text(encoding="utf-8"), layout_of(study))
    if again != (report / "table.csv").read_text(encoding="utf-8"):
        yield "table.csv does not follow from records.csv; run 'holoeval report' on its config"
