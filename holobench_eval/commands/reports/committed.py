"""A finished report as ``holoeval check`` reads it: its study and its provenance."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.errors import UserError

if TYPE_CHECKING:
    from ...study.definition import Study

NEEDED = ("records.csv", "table.csv")


def reports_in(folder: Path) -> list[Path]:
    """The reports of studies in a folder, or the folder itself where it is one."""
    from ...study.running import provenance

    if (folder / provenance.FILE).is_file():
        return [folder]
    return sorted(path.parent for path in folder.glob(f"*/{provenance.FILE}"))


def read(report: Path) -> tuple[Study, dict[str, Any]]:
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
        again = f"'holoeval run {config.resolve().name}' goes on with it"
        raise UserError(f"a run into this folder is in progress, or was stopped before its end; {again}")
    missing = [name for name in NEEDED if not (report / name).is_file()]
    if missing:
        raise UserError(f"{' and '.join(missing)} missing; 'holoeval report' on its config writes them")
    return load_study(config, recorded(known)), known
