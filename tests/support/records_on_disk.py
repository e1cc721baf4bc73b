"""A report folder with a records.csv of chosen scores and a provenance, for tests of what reads reports."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from holobench_eval.report.results import csv_text

Scores = Mapping[tuple[str, str], Sequence[float | None]]  # (method, display): PSNR [dB] of a target each, None: failed


def write_report(folder: Path, scores: Scores, provenance: Mapping[str, Any] | None = None) -> Path:
    """Write records.csv with the targets ``t0``, ``t1`` ..., and provenance.json unless it is None."""
    rows = [
        {
            **dict.fromkeys(("study", "measure", "swept", "swept_unit", "swept_name", "category"), ""),
            **dict.fromkeys(("capture_limit", "panel_height_px", "panel_width_px", "swept_value"), float("nan")),
            "display": display,
            "condition": display,
            "method": method,
            "label": method,
            "target": f"t{index}",
            "cluster": f"t{index}",
            "repeat": 0.0,
            "seed": 0,
            "state": "failed" if value is None else "done",
            "reason": "no light" if value is None else "",
            "psnr_linear_db": float("nan") if value is None else value,
            "flip_srgb": float("nan") if value is None else 1 / value,
            **dict.fromkeys(("captures", "solving_s", "registration_residual_px", "saturated"), 0.0),
            "cell": f"{method} {display} {index}",
            **dict.fromkeys(("exposure", "display_version", "protocol"), "1"),
        }
        for (method, display), values in scores.items()
        for index, value in enumerate(values)
    ]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "records.csv").write_text(csv_text(pd.DataFrame(rows)))
    if provenance is not None:
        (folder / "provenance.json").write_text(json.dumps(provenance))
    return folder
