from __future__ import annotations

import hashlib

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from holobench_eval.study.running import provenance
from holobench_eval.study.store import Store
from holobench_eval.study.versions import HARNESS
from tests.study.studies import compute
from tests.support.studies.fake_study import write_config


@pytest.mark.usefixtures("no_physics")
def test_a_run_says_what_it_ran_on(tmp_path):
    config = write_config(tmp_path, count=1)
    known = compute(config, tmp_path / "out").provenance
    assert known == provenance.read(tmp_path / "out")
    assert known["config_sha256"] == hashlib.sha256(config.read_bytes()).hexdigest()
    assert known["config"] == "../study.yaml"
    assert known["profiles"]["ideal"]["version"] == 1
    assert known["displays"] == {"ideal": "simulated"}
    assert known["packages"]["torch"]
    assert known["harness"] == HARNESS
    assert (known["threads"], known["workers"]) == (1, 1)
    assert known["started"] <= known["ended"]
    assert known["earlier"] == []


@pytest.mark.usefixtures("no_physics")
def test_a_run_keeps_the_runs_it_completes_and_is_noted_though_it_needs_nothing_computed(tmp_path):
    config, store = write_config(tmp_path, count=1), Store(tmp_path / "out")
    first = compute(config, store.output).provenance
    cells = plan(load_study(config)).cells
    store.path(cells[0].id).unlink()
    second = compute(config, store.output).provenance
    config = write_config(tmp_path, ('{name: "plugins.py:Toy", label: renamed}',), count=1)
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
