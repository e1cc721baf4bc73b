"""One truth: two committed reports say the same of the same thing, on a page each and in few words."""

import json
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[2]
REPORTS = sorted(path.parent for path in (ROOT / "reports").glob("**/board.json"))
SEED = 0.03  # dB: what another seed, or another run of a descent, moves a mean by
MOST_LINES = 80
MOST_WORDS = 40
OF_TABLE = ["measure", "method", "parameters", "condition", "learned_sha256"]
SAME = [*OF_TABLE, "panel", "exposure", "capture_limit", "targets"]


@pytest.fixture(scope="module")
def rows() -> pd.DataFrame:
    """The rows of every table.csv, with the targets and the state of training behind each."""
    frames = []
    for folder in REPORTS:
        table, cells = (pd.read_csv(folder / name, low_memory=False) for name in ("table.csv", "records.csv"))
        cells = cells[cells["state"] == "done"]
        facts = cells.groupby(["label", "condition"]).agg(
            targets=("target", lambda names: " ".join(sorted(set(names)))),
            panel=("panel_height_px", "first"),
            capture_limit=("capture_limit", "first"),
            exposure=("exposure", "first"),
        )
        table = table.reindex(columns=[*{*table.columns} & {*SAME, "label", "category", "psnr_linear_db"}])
        merged = table.merge(facts.reset_index(), on=["label", "condition"]).assign(report=str(folder))
        frames.append(merged.reindex(columns=[*SAME, "label", "report", "category", "psnr_linear_db"]))
    whole = pd.concat(frames, ignore_index=True)
    return whole[whole["category"] != "floor"]


def test_eleven_folders_hold_all_reports() -> None:
    assert len({folder.relative_to(ROOT / "reports").parts[0] for folder in REPORTS}) == 11


def test_a_method_on_a_display_over_the_same_targets_has_one_number(rows: pd.DataFrame) -> None:
    # an oracle starts from the phases of all other methods of its study
    groups = (
        rows[rows["category"] != "oracle"]
        .fillna({"learned_sha256": "", "capture_limit": 0})
        .groupby(SAME, dropna=False)
    )
    ends = groups["psnr_linear_db"].agg(["min", "max", "count"])
    assert (ends["count"] > 1).sum() > 20
    apart = ends[ends["max"] - ends["min"] > SEED]
    assert apart.empty, apart.to_string()


def test_one_name_of_a_row_is_one_method_with_one_setting(rows: pd.DataFrame) -> None:
    known = rows.assign(own=rows["method"] + rows["parameters"]).groupby("label")["own"].nunique()
    assert known[known > 1].index.tolist() == []


@pytest.mark.parametrize("folder", REPORTS, ids=lambda folder: folder.relative_to(ROOT / "reports").as_posix())
def test_a_report_fits_a_page_and_answers_in_few_words(folder: Path) -> None:
    text = (folder / "report.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= MOST_LINES
    answer = text.partition("## Answer\n\n")[2].partition("\n\n")[0]
    verdicts = [line.removeprefix("- ") for line in answer.splitlines()]
    assert verdicts
    assert [verdict for verdict in verdicts if len(verdict.split()) > MOST_WORDS] == []


@pytest.mark.parametrize("folder", REPORTS, ids=lambda folder: folder.relative_to(ROOT / "reports").as_posix())
def test_frames_never_stand_in_a_group_with_one_frame(folder: Path) -> None:
    table = pd.read_csv(folder / "table.csv").set_index(["label", "condition"])
    for display in json.loads((folder / "board.json").read_text(encoding="utf-8"))["displays"]:
        for group in display["groups"]:
            keys = [(row["method"], display["name"]) for row in group["rows"]]
            frames = table.loc[keys, "frames"] if "frames" in table else pd.Series([1.0])
            assert len({bool(count > 1) for count in frames.fillna(1)}) == 1
