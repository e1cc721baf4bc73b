"""A folder of results as somebody hands it in: records.csv, tests.csv, provenance.json and thumbnails."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from PIL import Image

from holobench_eval.core.hashing import digest
from holobench_eval.display import load_profile
from holobench_eval.report import Results, records_frame
from holobench_eval.report.data.tables import csv_text
from holobench_eval.report.files.tests_csv import comparison_frame
from holobench_eval.study.versions import HARNESS
from tests.support import synthetic_study as synthetic

TARGETS = synthetic.TARGETS[:4]
SCORES = ("psnr_linear", "ssim_linear", "ms_ssim_linear", "efficiency")
REPORT = (
    "# A title\n\n## Question\n\nIs it <b>better</b>?\n\n## Answer\n\n- [Yes](https://example.org)\n\n## More\n\nNo.\n"
)


def provenance(**changes: Any) -> dict[str, Any]:
    """That of a run on this version's displays."""
    profiles = {name: {"version": 1, "sha256": load_profile(name).digest} for name in synthetic.SEVERITY}
    given = {"package": "0.1.0", "harness": HARNESS, "board": True, "profiles": profiles, "cpu": "A processor"}
    return given | changes


def write_results(
    folder: Path,
    records: Sequence[Mapping[str, Any]],
    by: str | None = None,
    thumbnails: int = 0,
    known: Mapping[str, Any] | None = None,
) -> Path:
    """A folder with the files of these records; an own one (by is None) has a report.md, too."""
    records = [{**record, "id": digest(record["cell"])} for record in records]
    pairs = tuple(dict.fromkeys((r["label"], r["cell"]["condition"]) for r in records))
    shown = tuple(pair for pair in pairs if pair[1] != "reference")
    panels = {record["cell"]["profile"]: (256, 256) for record in records}
    camera = frozenset(r["label"] for r in records if r["scores"].get("captures", r.get("captures", 0)))
    layout = synthetic.layout(targets=TARGETS, pairs=shown, panels=panels, study=folder.name, camera=camera)
    results = Results(records_frame([_short(record) for record in records], layout), layout)
    folder.mkdir(parents=True, exist_ok=True)
    frames = {"records.csv": results.frame, "tests.csv": comparison_frame(results)}
    if by is None:
        frames["table.csv"] = results.table
    for name, frame in frames.items():
        (folder / name).write_text(csv_text(frame), encoding="utf-8")
    told = provenance(**(known or {})) | ({"by": by} if by is not None else {})
    (folder / "provenance.json").write_text(json.dumps(told))
    if by is None:
        (folder / "report.md").write_text(REPORT)
    done = [r for r in records if r["state"] == "done" and r["label"] == "HIL"]
    for record in done[:thumbnails]:
        path = folder / "thumbnails" / f"{record['id']}.png"
        path.parent.mkdir(exist_ok=True)
        Image.new("RGB", (32, 24), (200, 40, 40)).save(path)
    return folder


def _short(record: Mapping[str, Any]) -> dict[str, Any]:
    """A record with few of its scores, which is quicker."""
    return {**record, "scores": {key: value for key, value in record["scores"].items() if key in SCORES}}


def edited(folder: Path, column: str, value: str, row: int = -1) -> None:
    """Write another value into a column of a row of records.csv (-1: the last)."""
    import pandas as pd

    frame = pd.read_csv(folder / "records.csv", dtype=str, keep_default_na=False)
    frame.loc[frame.index[row], column] = value
    frame.to_csv(folder / "records.csv", index=False)
