"""A folder with the files of a report that the site reads."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from holobench_eval.core.hashing import digest
from holobench_eval.display import load_profile
from holobench_eval.report import Results, records_frame
from holobench_eval.study.versions import HARNESS
from tests.support import synthetic_study as synthetic
from tests.support.reports import write_texts

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
    known: Mapping[str, Any] | None = None,
) -> Path:
    """A folder with the files of data of these records, a report.md and a provenance.json."""
    records = [{**record, "id": digest(record["cell"])} for record in records]
    pairs = tuple(dict.fromkeys((r["label"], r["cell"]["condition"]) for r in records))
    shown = tuple(pair for pair in pairs if pair[1] != "reference")
    panels = {record["cell"]["profile"]: (256, 256) for record in records}
    camera = frozenset(r["label"] for r in records if r["scores"].get("captures", r.get("captures", 0)))
    facts = synthetic.facts(targets=TARGETS, pairs=shown, panels=panels, study=folder.name, camera=camera)
    results = Results(records_frame([_short(record) for record in records], facts), facts)
    write_texts(results, folder)
    (folder / "provenance.json").write_text(json.dumps(provenance(**(known or {}))))
    (folder / "report.md").write_text(REPORT)
    return folder


def _short(record: Mapping[str, Any]) -> dict[str, Any]:
    """A record with few of its scores, which is quicker."""
    return {**record, "scores": {key: value for key, value in record["scores"].items() if key in SCORES}}
