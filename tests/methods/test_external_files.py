"""Files that a method takes where a machine has them are part of its phases and trainings, and of no others."""

import hashlib
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.core import plugins
from holobench_eval.methods.learned import retrieval
from holobench_eval.study.config import load_study
from holobench_eval.study.isolation import external
from holobench_eval.study.plan import plan

LPIPS, VGG = "LPIPS weights (AlexNet)", "VGG-19 weights"
BARE = {"retrieval": {"perceptual": 0.0}, "loss": {"perceptual": 0.0}}
STUDY = """title: weights
display: {profiles: [ideal], panel: [128, 160]}
targets: {dataset: photographs, params: {count: 1}}
training: {dataset: dead_leaves, params: {count: 2}, held_out: 1}
protocol: {metrics: [psnr]}
methods: [wirtinger, parametric_model, hil]
"""


@pytest.fixture
def checkpoints(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of weights of a machine without any."""
    monkeypatch.setenv("TORCH_HOME", str(tmp_path))
    folder = tmp_path / "hub" / "checkpoints"
    folder.mkdir(parents=True)
    return folder


@pytest.mark.parametrize(
    ("name", "params", "names"),
    [
        ("hil", {}, {LPIPS, VGG}),
        ("hil", BARE, set()),
        ("hil", {"network": {"name": "pix2pixhd"}, "retrieval": {"perceptual": 0.0}}, {VGG}),
        ("hil_nh3d", {"network": {"name": "proposed"}}, {VGG}),
        ("online_camera_network", {"loss": None}, {VGG}),
        ("parametric_model", {"search": {"perceptual": 1.0}}, {LPIPS}),
        ("wirtinger", {}, set()),
    ],
)
@pytest.mark.usefixtures("checkpoints")
def test_a_method_names_what_its_parameters_use(name: str, params: dict[str, Any], names: set[str]) -> None:
    assert external(plugins.build("methods", name, params)) == dict.fromkeys(names, "absent")


def ids(folder: Path) -> tuple[dict[str, str], dict[str, str]]:
    """Identities of cells and of trainings, by method."""
    (folder / "study.yaml").write_text(STUDY)
    planned = plan(load_study(folder / "study.yaml"))
    cells = {label: cell.id for label, cell in planned.labelled()}
    return cells, {training.method: training.id for training in planned.preparations().values()}


def test_weights_that_arrive_make_other_phases_of_what_uses_them_alone(tmp_path, checkpoints, monkeypatch) -> None:
    cells, trainings = ids(tmp_path)
    weights = checkpoints / "alexnet-owt-7be5be79.pth"
    weights.write_bytes(b"weights")
    monkeypatch.setattr(retrieval, "available", lambda network: None)  # whether or not torchmetrics is here
    digest = hashlib.sha256(b"weights").hexdigest()
    assert external(plugins.build("methods", "hil", {})) == {LPIPS: digest, VGG: "absent"}
    after, trainings_after = ids(tmp_path)
    assert {label for label in cells if cells[label] != after[label]} == {"hil"}
    assert {name for name in trainings if trainings[name] != trainings_after[name]} == {"hil"}
