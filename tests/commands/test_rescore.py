"""``holoeval rescore`` and ``check`` with a metric that came, or changed, after a study was run."""

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from holobench_eval.commands.reports.check import kept_in, problems_in
from holobench_eval.commands.reports.report import report as write_again
from holobench_eval.core.errors import UserError
from holobench_eval.core.hashing import digest
from holobench_eval.lab.real import RealBench
from holobench_eval.lab.session import read_manifest
from holobench_eval.metrics import catalogue
from holobench_eval.report import build_report, scores
from holobench_eval.study import executors, identity
from holobench_eval.study.config import load_study
from holobench_eval.study.identity import parted
from holobench_eval.study.phases import phases_of
from holobench_eval.study.running import provenance
from holobench_eval.study.store import Store
from tests.commands.photographs import test_moved_session as sessions
from tests.lab.session.running import run, succeed
from tests.study.running.test_rescore import BOTH, ONE, PICTURE, cells, forget
from tests.study.studies import planned
from tests.support.studies import another_metric
from tests.support.studies.another_metric import COLUMN, NAME
from tests.support.studies.trained_study import compute


@pytest.fixture(autouse=True)
def _one_process(monkeypatch):
    """Others would not know the metric."""
    monkeypatch.setattr(executors, "executor", lambda *_, **__: executors.Serial())


@pytest.fixture
def add(tmp_path, monkeypatch):
    """Puts the metric at a version into the catalogue, and into the columns that reports know."""

    def added(version: int) -> None:
        another_metric.add(tmp_path, monkeypatch, version)
        monkeypatch.setattr(scores, "METRICS", {metric.name: metric for metric in catalogue()})

    return added


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A folder with a study and its report."""
    config = tmp_path_factory.mktemp("finished") / "study.yaml"
    config.write_text(PICTURE)
    outcome = compute(config)
    build_report(load_study(config), outcome.records, config.parent / "out", outcome.provenance)
    return config.parent


def edited(record: Path) -> None:
    """Give a record another score, and its digest anew."""
    content = json.loads(record.read_text())
    del content["sha256"]
    content["scores"]["psnr"]["values"]["psnr_linear"] += 1
    record.write_text(json.dumps({**content, "sha256": digest(content)}))


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("nothing", ""),
        ("record", "double_phase on leto-mild, tv_lines: psnr_linear is .* in records/.*.json, and .* of the kept"),
        ("row", "double_phase on leto-mild, tv_lines: psnr_linear is 1 in records.csv, and .* of the kept capture"),
        ("capture", "double_phase on leto-mild, tv_lines: its kept capture is damaged, of another cell"),
    ],
)
def test_a_record_that_its_kept_capture_does_not_give_is_told(finished, tmp_path, what, message, capsys):
    shutil.copytree(finished, tmp_path, dirs_exist_ok=True)
    store, (first, second) = Store(tmp_path / "out"), cells(tmp_path / "study.yaml")
    if what == "record":
        edited(store.path(first.id))
    if what == "row":
        rows = pd.read_csv(tmp_path / "out/records.csv")
        rows.loc[rows["cell"] == first.id, "psnr_linear_db"] = 1.0
        rows.to_csv(tmp_path / "out/records.csv", index=False)
    if what == "capture":
        shutil.copy(store.capture(second.id), store.capture(first.id))
    told = kept_in(tmp_path, 0)
    assert capsys.readouterr().out.endswith("out: 2 of 2 kept captures scored again\n")
    assert len(told) == bool(message), told
    assert not told or re.search(message, told[0])


@pytest.fixture
def report(finished, tmp_path, add):
    """The folder of a finished study, whose config has named a metric more since."""
    add(1)
    shutil.copytree(finished, tmp_path, dirs_exist_ok=True)
    (tmp_path / "study.yaml").write_text(PICTURE.replace(ONE, BOTH))
    return tmp_path / "out"


def test_the_column_of_a_new_metric_is_filled_and_written_into_the_tables(report):
    config = report.parent / "study.yaml"
    before = pd.read_csv(report / "records.csv")
    said = succeed("rescore", config, "--output", report, "--metric", NAME, "--threads", 1)
    assert "14 captures scored again, 0 solved" in said
    assert "no whole capture" not in said
    after = pd.read_csv(report / "records.csv")
    (new,) = set(after) - set(before)
    assert new.startswith(COLUMN)
    assert after[new].notna().all()
    pd.testing.assert_frame_equal(after[list(before)], before)
    assert problems_in(report) == (1, [])
    store = Store(report)  # which has one record and one capture for each cell
    assert {path.stem for path in store.folder.glob("*.json")} == {cell.id for cell in planned(config).cells}
    assert {path.stem for path in store.folder.glob("*.npy")} == {cell.id for cell in cells(config)}


def test_a_plan_says_which_columns_of_what_is_done_are_empty(report):
    config = report.parent / "study.yaml"
    said = succeed("plan", config, "--output", report)
    (line,) = (line for line in said.splitlines() if "lack scores" in line)
    assert line.startswith(f"14 of the done cells lack scores: {NAME}. 'holoeval rescore' fills them from kept")
    succeed("rescore", config, "--output", report)
    assert "lack scores" not in succeed("plan", config, "--output", report)


def test_what_nothing_kept_can_fill_is_said_and_stays_a_hole(report):
    config = report.parent / "study.yaml"
    forget(config)
    said = succeed("rescore", config, "--output", report)
    words = " ".join(said.split())
    assert (
        "12 captures scored again, 0 solved; 2 have no whole capture of their own kept, and holoeval run computes them"
        in words
    )
    assert pd.read_csv(report / "records.csv").filter(like=COLUMN).isna().sum().item() == 2


def test_a_metric_that_the_study_does_not_have_is_refused_with_the_nearest(report):
    _, failure = run("rescore", report.parent / "study.yaml", "--output", report, "--metric", "psnt")
    assert failure.startswith("--metric psnt: the study has no such metric; did you mean 'psnr'? allowed: match, peak")


def test_a_study_that_was_never_run_is_told_so_and_nothing_is_solved(tmp_path, add):
    config = tmp_path / "study.yaml"
    config.write_text(PICTURE)
    _, failure = run("rescore", config, "--output", tmp_path / "never")
    assert failure == f"{tmp_path / 'never'} has no captures; holoeval run {config} takes them"
    assert not phases_of(tmp_path / "never").folder.exists()


def test_a_metric_more_in_the_package_is_no_problem_of_a_report(tmp_path, add, no_physics):
    config, folder = tmp_path / "study.yaml", tmp_path / "out"
    config.write_text(PICTURE.replace(f"{ONE}\n", ""))  # scored by every metric that there is
    outcome = compute(config)
    build_report(load_study(config), outcome.records, folder, outcome.provenance)
    assert problems_in(folder) == (1, [])
    add(1)
    assert NAME in planned(config).metrics
    assert problems_in(folder) == (1, [])


def test_a_report_of_another_version_of_a_metric_is_found_until_it_is_scored_again(report, add):
    config = report.parent / "study.yaml"
    succeed("rescore", config, "--output", report)
    add(2)
    _, problems = problems_in(report)
    assert problems == [f"{report}: '{NAME}' was of version v2, 1, is now of v2, 2; score its captures again"]
    succeed("rescore", config, "--output", report)
    assert problems_in(report) == (1, [])


def test_no_photograph_of_a_display_that_exists_is_taken_or_asked_for_because_of_a_metric(tmp_path, add, monkeypatch):
    add(1)
    session = sessions.moved(tmp_path, monkeypatch, sessions.STUDY.replace("[psnr]", f"[psnr, {NAME}]"))
    succeed("session", "import", session)
    assert kept_in(session / "report", 0) == []
    photographs, photograph = list[str](), RealBench.photograph

    def photographed(self: RealBench, *args: Any, **named: Any) -> Any:
        photographs.append(str(named["item"]))
        return photograph(self, *args, **named)

    monkeypatch.setattr(RealBench, "photograph", photographed)
    for version, is_kept in ((2, True), (3, False)):
        for file in Store(session / "report").folder.glob("*.npy") if not is_kept else ():
            file.unlink()
        add(version)
        succeed("session", "import", session)
        assert photographs == []
        assert read_manifest(session).rounds == 1
        table = pd.read_csv(session / "report" / "records.csv").set_index("method")
        assert table.filter(like="psnr_linear").loc["double_phase"].notna().all()
        assert table.filter(like=COLUMN).loc["double_phase"].notna().item() == is_kept


def test_scores_by_an_earlier_protocol_are_holes_until_the_kept_captures_are_scored(tmp_path, monkeypatch):
    config, folder = tmp_path / "study.yaml", tmp_path / "out"
    config.write_text(PICTURE)
    with monkeypatch.context() as earlier:
        earlier.setattr(identity, "PROTOCOL", "v1")
        identity.versions.cache_clear()
        outcome = compute(config)
        build_report(load_study(config), outcome.records, folder, outcome.provenance)
    identity.versions.cache_clear()
    before = pd.read_csv(folder / "records.csv")
    assert kept_in(folder, 0) == []  # there is nothing to compare
    with pytest.raises(UserError, match=r"no score 'psnr_linear' of today's versions \(protocol v2\)"):
        write_again(config, folder)
    said = succeed("rescore", config, "--output", folder)
    assert "14 captures scored again, 0 solved" in said
    pd.testing.assert_frame_equal(pd.read_csv(folder / "records.csv"), before)
    assert {parted(version)[0] for version in provenance.read(folder)["scores"].values()} == {"v2"}
    assert problems_in(folder) == (1, [])
