import hashlib
import re
from unittest.mock import patch

import pytest
import torch

from holobench_eval.commands.plan import preview
from holobench_eval.core.errors import StorageError, UserError
from holobench_eval.core.io import file_name
from holobench_eval.core.pictures import open_picture
from holobench_eval.report import Results, facts_of, records_frame
from holobench_eval.study.config import load_study
from holobench_eval.study.executors import Serial
from holobench_eval.study.executors.clusters import Address
from holobench_eval.study.executors.local import Local
from holobench_eval.study.plan import plan
from holobench_eval.study.running import provenance
from holobench_eval.study.running.progress import Lines
from holobench_eval.study.store import Store
from holobench_eval.study.versions import HARNESS
from tests.study.studies import TURNS, add_one_laser, compute, planned
from tests.support.studies.fake_study import solves, untimed, write_config, write_inside

pytestmark = pytest.mark.usefixtures("no_physics")


def test_what_is_there_is_never_computed_again_and_what_is_missing_is(tmp_path):
    config, output = write_inside(tmp_path), tmp_path / "out"
    first = compute(config, output)
    assert {record["state"] for record in first.records} == {"done"}
    assert (first.computed, first.failed, len(first.records)) == (3 * 6 + 3, 0, 3 * 6 + 3)
    again = compute(config, output)
    assert again.computed == 0
    assert (again.records, again.provenance) == (first.records, first.provenance)
    Store(output).path(planned(config).tasks[-1].cells[0].id).unlink()
    again = compute(config, output)
    assert again.computed == 1
    assert untimed(again.records) == untimed(first.records)
    assert len(solves(tmp_path)) == 3  # the phase was kept
    renamed, other = (
        f'{{name: "plugins.py:Toy", label: {label}}}' for label in ("renamed", "other, params: {value: 2}")
    )
    again = compute(write_inside(tmp_path, (renamed,)), output)
    assert again.computed == 0
    assert {record["label"] for record in again.records[-3:]} == {"renamed"}
    more = compute(write_inside(tmp_path, ("plugins.py:Toy", other)), output)
    assert (more.computed, len(more.records)) == (3, 3 * 6 + 2 * 3)


def test_an_exception_in_a_method_is_a_failed_cell_that_is_computed_again_only_when_asked(tmp_path):
    lines: list[str] = []
    config = write_config(tmp_path, ('{name: "plugins.py:Toy", params: {fail: "no\\n light"}}',))
    outcome = compute(config, tmp_path / "out", lines.append)
    states = [(record["cell"]["target"], record["state"]) for record in outcome.records[-3:]]
    assert states == [("gray 0", "done"), ("gray 1", "failed"), ("gray 2", "done")]
    failed = outcome.records[-2]
    assert re.fullmatch(r"ValueError: no light \(plugins\.py, line \d+\)", failed["reason"])
    assert (outcome.failed, failed["scores"]) == (1, {})
    store = Store(tmp_path / "out")
    assert "Traceback" in store.log(planned(config).cells[-2].id).read_text()
    assert any("gray 1" in line and "no light" in line for line in lines)
    assert compute(config, tmp_path / "out").computed == 0
    again = compute(config, tmp_path / "out", retry_failed=True)
    assert (again.computed, again.failed) == (1, 1)
    assert len(solves(tmp_path)) == 4


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("Disguised", "what solve returned: a value is Target"),  # a tensor with a class of its own
        ("Nameless", r"^ValueError: \\udcff\.png \(plugins\.py, "),  # no Unicode
    ],
)
def test_what_is_no_phase_and_no_text_is_a_failed_cell_with_a_reason(tmp_path, name, reason):
    config = write_config(tmp_path, (f'{{name: "plugins.py:{name}"}}',), count=1)
    record = compute(config, tmp_path / "out").records[-1]
    assert record["state"] == "failed"
    assert re.search(reason, record["reason"])
    assert compute(config, tmp_path / "out").computed == 0


@pytest.mark.parametrize("executor", [Serial(), Local(2)], ids=["here", "workers"])
def test_a_full_disk_stops_the_run_and_fails_no_cell(tmp_path, executor):
    config, store = write_inside(tmp_path, count=1), Store(tmp_path / "out")
    compute(config, store.output)
    cells = planned(config).cells
    store.remove(cell.id for cell in cells)
    refused = store.thumbnail(cells[-1].id)
    refused.unlink()
    refused.mkdir()  # no file can have this name, as none can be written to a full disk
    with pytest.raises(StorageError, match=rf"{refused.name} cannot be written: .*; mend that, and run the same"):
        compute(config, store.output, executor=executor)
    assert store.read(cells[-1].id) is None
    refused.rmdir()
    assert compute(config, store.output, executor=executor).failed == 0


def test_a_score_that_is_not_finite_is_a_failed_cell(tmp_path, monkeypatch):
    monkeypatch.setattr("holobench_eval.study.scoring.scores.score", lambda *_, **__: {"psnr_linear": float("nan")})
    records = compute(write_inside(tmp_path, count=1), tmp_path / "out").records
    assert {(record["state"], record["reason"]) for record in records} == {("failed", "the score psnr_linear is nan")}


def test_targets_keep_their_pictures_when_displays_change_places(tmp_path):
    add_one_laser(tmp_path)
    for order in ("ideal, one.yaml", "one.yaml, ideal", "ideal, one.yaml"):
        config = write_inside(tmp_path, profiles=order, count=1)
        facts = facts_of(load_study(config))
        results = Results(records_frame(compute(config, tmp_path / "out").records, facts), facts)
        shapes = [results.shape(results.reference(name)) for name in ("ideal", "one")]
        paths = [Store(tmp_path / "out").target_thumbnail("gray 0", shape) for shape in shapes]
        assert [open_picture(path.read_bytes()).channels for path in paths] == [3, 1], order


SAVED = ("captures", ".json"), ("captures", ".png"), ("phases", ".npy"), ("phases", ".png")


def test_captures_and_phases_are_saved_on_request(tmp_path):
    config = write_inside(tmp_path, ('{name: "plugins.py:Toy", label: "a/b"}',), count=1)
    config.write_text(config.read_text() + "save: {captures: true, phases: true}\n")
    compute(config, tmp_path / "out")
    written = {str(path.relative_to(tmp_path / "out")) for path in (tmp_path / "out").rglob("*/*/*.*")}
    place = f"{file_name('a/b')}/ideal/{file_name('gray 0')}"
    assert written == {f"{kind}/{place}{ending}" for kind, ending in SAVED}


def test_a_folder_in_use_by_another_run_is_refused(tmp_path):
    config = write_inside(tmp_path, count=1)
    with Store(tmp_path / "out").locked(), pytest.raises(UserError, match="another run is using this folder"):
        compute(config, tmp_path / "out")
    assert compute(config, tmp_path / "out").computed == 5 + 1


def test_an_interrupt_keeps_what_was_computed(tmp_path):
    config = write_inside(tmp_path)
    with patch.object(Lines, "finished", side_effect=KeyboardInterrupt), pytest.raises(KeyboardInterrupt):
        compute(config, tmp_path / "out")
    assert compute(config, tmp_path / "out").computed == 21 - 6
    earlier = provenance.read(tmp_path / "out")["earlier"]
    assert [run["ended"] for run in earlier] == [None]


def test_a_study_that_is_to_be_timed_alone_computes_the_timed_cells_of_an_earlier_run_again(tmp_path):
    config = write_inside(tmp_path)
    shared = compute(config, tmp_path / "out", executor=TURNS)
    assert [record["alone"] for record in shared.records[-3:]] == [False] * 3
    config.write_text(f"{config.read_text()}timing: alone\n")
    study = load_study(config)
    foreseen = preview(study, plan(study), Store(tmp_path / "out"), threads=1, workers=2)
    assert [(row.done, row.missing) for row in foreseen] == [(18, 0), (2, 1)]
    for computed in (1, 0):
        alone = compute(config, tmp_path / "out", executor=TURNS)
        assert alone.computed == computed
        assert [record["alone"] for record in alone.records[-3:]] == [False, False, True]
    assert [record["alone"] for record in compute(config, tmp_path / "single").records[-3:]] == [True] * 3


def test_workers_that_may_come_time_nothing_alone_unless_asked(tmp_path, monkeypatch):
    monkeypatch.setattr(Address, "workers", 1)
    monkeypatch.setattr(Address, "map", Serial.map)
    records = compute(write_inside(tmp_path), tmp_path / "out", executor=Address("tcp://a:1")).records
    assert [record["alone"] for record in records[-3:]] == [False] * 3


def test_seconds_are_those_of_the_study_that_reports_them(tmp_path):
    config = write_inside(tmp_path, ('{name: "plugins.py:Toy", params: {pause: 0.05}}',), count=1)
    first, other, again = (compute(config, tmp_path / name).records[-1]["seconds"] for name in "aba")
    assert other != first == again >= 0.05


def test_a_method_that_cannot_run_here_is_refused_at_once_where_something_is_left_for_it(tmp_path):
    config, here = write_inside(tmp_path, ("plugins.py:Toy", "plugins.py:Needy")), tmp_path / "here"
    with pytest.raises(UserError, match=r"^method 'plugins.py:Needy' cannot run here: no lens; buy one$"):
        compute(config, tmp_path / "out")
    assert solves(tmp_path) == []
    here.touch()
    compute(config, tmp_path / "out")
    here.unlink()
    compute(config, tmp_path / "out")
    assert len(solves(tmp_path)) == 6


@pytest.mark.parametrize("asked", ["protocol: {metrics: [psnr, lpips_alex]}", "headline: lpips_alex_srgb"])
def test_a_metric_without_its_weights_is_refused_by_a_run_alone(tmp_path, monkeypatch, asked):
    monkeypatch.setattr(torch.hub, "get_dir", lambda: str(tmp_path / "hub"))
    config = write_inside(tmp_path)
    config.write_text(f"{config.read_text()}\n{asked}\n")
    assert planned(config).metrics["lpips_alex"] == "v2, 0.1"  # as with the weights
    with pytest.raises(UserError, match="metric 'lpips_alex' cannot be computed here: no trunk weights"):
        compute(config, tmp_path / "out")
    assert not solves(tmp_path)


def test_a_run_says_what_it_ran_on(tmp_path):
    config = write_inside(tmp_path, count=1)
    known = compute(config, tmp_path / "out").provenance
    assert known == provenance.read(tmp_path / "out")
    assert known["profiles"]["ideal"]["version"] == 1
    assert known["packages"]["torch"]
    assert known["started"] <= known["ended"]
    wanted = {"config": "../study.yaml", "displays": {"ideal": "simulated"}, "harness": HARNESS}
    wanted |= {"config_sha256": hashlib.sha256(config.read_bytes()).hexdigest(), "earlier": []}
    assert known == known | wanted | {"threads": 1, "workers": 1}


def test_a_run_keeps_the_runs_it_completes_and_is_noted_though_it_needs_nothing_computed(tmp_path):
    config, store = write_inside(tmp_path, count=1), Store(tmp_path / "out")
    first = compute(config, store.output).provenance
    cells = planned(config).cells
    store.path(cells[0].id).unlink()
    second = compute(config, store.output).provenance
    config = write_inside(tmp_path, ('{name: "plugins.py:Toy", label: renamed}',), count=1)
    third = compute(config, store.output).provenance
    assert [run["started"] for run in third["earlier"]] == [first["started"], second["started"]]
    assert third["earlier"][0] == {key: value for key, value in first.items() if key != "earlier"}
    assert third["config_sha256"] == hashlib.sha256(config.read_bytes()).hexdigest()
    assert third["ended"]
    assert compute(config, store.output).provenance == third
    store.remove(cell.id for cell in cells)
    assert compute(config, store.output).provenance["earlier"] == []


@pytest.mark.parametrize("text", ["{", "[]", '{"earlier": 5}', '{"earlier": [5]}', "[" * 200_000])
def test_a_damaged_provenance_is_named(tmp_path, text):
    (tmp_path / "provenance.json").write_text(text)
    with pytest.raises(UserError, match=r"provenance\.json: .*; delete the file"):
        provenance.read(tmp_path)
