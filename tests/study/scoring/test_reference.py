"""A method of somebody else's code that changes the harness stops the run, and is named."""

from pathlib import Path

import pytest
import torch

from holobench_eval.core import plugins
from holobench_eval.core.errors import StopError
from holobench_eval.metrics import protocol
from holobench_eval.study.store import Store
from tests.study.studies import MILD, compute, write_study
from tests.support.plugins import text

METHODS = text("harmful")


def study(folder: Path, *methods: str) -> Path:
    (folder / "methods.py").write_text(METHODS)
    named = [f"'methods.py:{name}'" for name in methods]
    metrics = "{metrics: [psnr, ssim]}"
    return write_study(folder / "study.yaml", *named, "double_phase", display=MILD, protocol=metrics, isolation="none")


@pytest.fixture(autouse=True)
def _as_before(monkeypatch):
    """Undo what the methods change."""
    monkeypatch.setattr(protocol, "match", protocol.match)
    monkeypatch.setattr(torch, "randn", torch.randn)


def test_an_honest_method_is_let_through(tmp_path):
    outcome = compute(study(tmp_path, "honest"), tmp_path / "out")
    assert {record["state"] for record in outcome.records} == {"done"}


@pytest.mark.parametrize("name", ["flatterer", "silencer", "failing"])
def test_a_method_that_changes_the_harness_stops_the_run_and_scores_nothing(tmp_path, name):
    with pytest.raises(StopError, match=rf"method 'methods.py:{name}' has changed the harness: .* leto-mild"):
        compute(study(tmp_path, name), tmp_path / "out")
    scored = [path for path in Store(tmp_path / "out").folder.glob("*.json") if name in path.read_text()]
    assert scored == []


def test_what_the_package_ships_is_not_guarded(tmp_path):
    assert plugins.is_shipped("methods", "wirtinger")
    assert not plugins.is_shipped("methods", f"{tmp_path}/methods.py:honest")
