"""``holoeval check --rerun``: what of a committed report is reproduced, and what is found that is not."""

import json
import shutil
from collections import Counter
from pathlib import Path

import pytest

from holobench_eval.commands.reports.rerun import Planned, Verdict, rerun, sample
from holobench_eval.report import facts_of, recompute_files
from holobench_eval.report.results import csv_text, read_records, records_frame
from holobench_eval.study import executors
from holobench_eval.study.config import load_study
from holobench_eval.study.executors import Serial
from holobench_eval.study.plan import plan
from holobench_eval.study.running.run import Outcome
from tests.study.studies import compute
from tests.support.studies import trained_study
from tests.support.studies.fake_study import installed, solves, write_config

ALL = 1000
TWO = ("plugins.py:Toy", '{name: "plugins.py:Toy", label: other, params: {value: 5}}')


class Committed:
    """A report in ``reports/`` and the config beside that it is of."""

    def __init__(self, folder: Path) -> None:
        self.config, self.report = folder / "study.yaml", folder / "reports" / "study"

    def commit(self, outcome: Outcome) -> None:
        """Leave a report as it is committed: tables of a finished run, empty texts beside them, and no records."""
        self.write(csv_text(records_frame(outcome.records, facts_of(load_study(self.config)))))
        for name in ("report.md", "details.md"):
            (self.report / name).touch()
        shutil.rmtree(self.report / "records")

    def check(self, count: int = ALL, seed: int = 0) -> Verdict:
        artifacts = self.config.parent / "artifacts"
        return rerun(self.report, load_study(self.config), count, seed, artifacts, Serial())

    def change(self, method: str, by: float) -> str:
        """Add to the PSNR of the first cell of a method, in records.csv and in table.csv alike; return its target."""
        frame = read_records((self.report / "records.csv").read_text())
        first = frame.index[frame["label"] == method][0]
        frame.loc[first, "psnr_linear_db"] = round(frame.loc[first, "psnr_linear_db"] + by, 4)
        self.write(csv_text(frame))
        return str(frame.loc[first, "target"])

    def edit(self, old: str, new: str) -> None:
        """Another code of the methods."""
        plugins = self.config.with_name("plugins.py")
        plugins.write_text(plugins.read_text().replace(old, new))

    def write(self, records: str) -> None:
        """The tables that follow from a text of records.csv."""
        for name, text in recompute_files(records, facts_of(load_study(self.config))).items():
            (self.report / name).write_text(text)


def committed(folder: Path, *methods: str) -> Committed:
    write_config(folder, methods, count=2)
    made = Committed(folder)
    with installed():
        made.commit(compute(made.config, made.report))
    return made


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """The folder of a report of two methods."""
    return committed(tmp_path_factory.mktemp("toys"), *TWO).config.parent


@pytest.fixture
def toys(both, tmp_path, no_physics):
    """A copy of it."""
    shutil.copytree(both, tmp_path, dirs_exist_ok=True)
    return Committed(tmp_path)


@pytest.fixture
def trained(tmp_path, no_physics):
    """A report of a method that is trained, and its artifact."""
    made = Committed(tmp_path)
    made.commit(trained_study.compute(trained_study.write(tmp_path), "reports/study"))
    return made


def test_an_untouched_report_is_reproduced_to_the_digit_and_stays_untouched(toys):
    before = {path: path.read_bytes() for path in toys.report.iterdir() if path.is_file()}
    verdict = toys.check()
    floors, solved = 2 * 6, 2 * 2  # whose cells have two scores, and three
    assert verdict == Verdict(cells=floors + solved, reproduced=2 * floors + 3 * solved)
    assert {path: path.read_bytes() for path in toys.report.iterdir() if path.is_file()} == before


def test_a_sample_solves_no_more_than_its_cells(toys):
    before = len(solves(toys.config.parent))
    assert toys.check(count=3).cells == 3
    assert len(solves(toys.config.parent)) == before + 2  # the third is a floor


def test_a_number_that_was_changed_is_named_and_a_difference_between_machines_is_within_tolerance(toys):
    target = toys.change("other", 0.5)
    toys.change("Toy", 0.02)
    verdict = toys.check()
    (fault,) = verdict.faults
    named, _, numbers = fault.partition(" was ")
    was, now = map(float, numbers.split(", is "))
    assert (named, verdict.close) == (f"other on ideal, {target}: psnr_linear [dB]", 1)
    assert was - now == pytest.approx(0.5, abs=1e-3)


def test_scores_by_an_earlier_protocol_are_judged_with_a_word(toys):
    records = toys.report / "records.csv"
    records.write_text(records.read_text().replace(",v2", ",v1"))
    assert toys.check(count=2).notes == ["scores by metric protocol v1 beside those by v2 now"]


def test_a_method_that_makes_other_phases_is_found(toys):
    toys.edit("torch.full(shape, self.value)", "torch.full(shape, self.value + 9)")
    verdict = toys.check()
    found = {fault.split(":")[0] for fault in verdict.faults if "psnr_linear" in fault}
    assert found == {f"{label} on ideal, gray {index}" for label in ("Toy", "other") for index in range(2)}
    told = "16 of the cells in records.csv have another identity"  # the dataset is in the same file
    assert any(told in note for note in verdict.notes)


def test_a_method_that_fails_now_is_found(toys):
    toys.edit("time.sleep(self.pause)", 'raise ValueError("no light")')
    faults = toys.check().faults
    assert len(faults) == 4
    told = "Toy on ideal, gray 0: had a score, is failed now: ValueError: no light (plugins.py, line "
    assert any(fault.startswith(told) for fault in faults)


@pytest.mark.usefixtures("no_physics")
def test_what_cannot_be_rerun_is_named_or_counted(tmp_path):
    failing = '{name: "plugins.py:Toy", params: {fail: "no light"}}'
    following = '{name: "plugins.py:Following", label: oracle}'
    made = committed(tmp_path, failing, TWO[1], following)
    made.config.write_text(made.config.read_text().replace("label: other", "label: renamed"))
    verdict = made.check()
    assert verdict.cells == 2 * 6 + 1
    told = "2 rows of records.csv that the config does not plan", "1 row of records.csv without a score", "oracle (2 ce"
    assert all(words in note for words, note in zip(told, verdict.notes, strict=True))


def test_a_trained_method_needs_the_artifact_of_its_training(trained):
    assert trained.check().faults == []
    path, artifact = trained.report / "records.csv", trained_study.artifact_of(trained.config)
    text, sha256 = path.read_text(), json.loads((artifact / "provenance.json").read_text())["sha256"]
    path.write_text(text.replace(sha256, "f" * 64))
    (fault,) = trained.check().faults
    assert fault.endswith(f"learned state was ffffffffffff, is {sha256[:12]}: another artifact")

    frame = read_records(text)
    frame.loc[frame["label"] == "Gain", "training_s"] = 610
    path.write_text(csv_text(frame))
    shutil.rmtree(artifact.parent)
    verdict = trained.check()
    assert verdict.cells == 5
    (note,) = verdict.notes
    assert note.startswith("not rerun: Gain (1 cell): needs training of about 10 min")
    assert not artifact.parent.exists()


def test_cells_are_drawn_evenly_over_methods_and_displays(tmp_path):
    planned = candidates(tmp_path, displays=2, methods=3, targets=10)
    drawn = sample(planned, 12, seed=0)
    assert Counter(each.task.label for each in drawn) == {"floor": 3, "m0": 3, "m1": 3, "m2": 3}
    displays = Counter(each.key[1] for each in drawn if each.task.label != "floor")
    assert abs(displays["ideal"] - displays["leto-mild"]) <= 1


def test_the_draw_depends_on_the_seed_alone(tmp_path):
    planned = candidates(tmp_path, displays=1, methods=1, targets=20)
    first, again, other = (sample(cells, 5, seed) for cells, seed in ((planned, 0), (planned[::-1], 0), (planned, 1)))
    assert first == again
    assert first != other


def candidates(folder: Path, displays: int, methods: int, targets: int) -> list[Planned]:
    """The cells of a study that nobody computed."""
    entries = tuple(f'{{name: "plugins.py:Toy", label: m{i}, params: {{value: {i}}}}}' for i in range(methods))
    profiles = ", ".join(("ideal", "leto-mild")[:displays])
    grid = plan(load_study(write_config(folder, entries, targets, profiles)))
    return [
        Planned(task, cell, (cell.method if task.is_floor else task.label, cell.condition, cell.target, 0.0), {})
        for task in grid.tasks
        for cell in task.cells
    ]


@pytest.mark.parametrize(("by", "code"), [(0.0, 0), (0.5, 1)])
def test_the_command_says_what_it_found(toys, monkeypatch, call, by, code):
    monkeypatch.setattr(executors, "executor", lambda *_: Serial())
    monkeypatch.chdir(toys.config.parent)
    toys.change("Toy", by)
    ended, shown, _ = call("check", "--rerun", ALL)
    assert ended == code
    assert "reports/study: 16 cells computed again" in shown
    assert ("reports/study: Toy on ideal, gray 0: psnr_linear [dB] was" in shown) == bool(code)
    assert f"1 report, {code} problem" in shown


def test_a_run_that_is_not_finished_is_said_to_be_so(toys, monkeypatch, call):
    monkeypatch.chdir(toys.config.parent)
    for path in (toys.report / "records.csv", toys.report / "table.csv"):
        path.unlink()
    known = toys.report / "provenance.json"
    text = known.read_text()
    known.write_text(text[: text.index('"ended"')] + '"ended": null, "earlier": []}')
    code, shown, _ = call("check", "--rerun", 1)
    assert code == 1
    assert shown.count("a run into this folder is in progress, or was stopped before its end") == 2
    assert "1 report, 1 problem" in shown
    known.write_text(text)
    code, shown, _ = call("check")
    assert (code, "Errno" in shown) == (1, False)
    assert "reports/study: records.csv and table.csv missing; 'holoeval report' on its config writes them" in shown
