"""Where a study is computed: what is refused, what its records depend on, and what is told of it."""

import os

import pytest
import torch

from holobench_eval.core.device import CPU, repeatable
from holobench_eval.report.stories.overview import environment
from holobench_eval.study import cost
from holobench_eval.study.config import load_study
from holobench_eval.study.executors import Local, Serial, executor
from holobench_eval.study.executors.local import one_gpu
from holobench_eval.study.plan import plan
from holobench_eval.study.running import provenance
from tests.commands.test_commands import holoeval
from tests.study.studies import compute, planned, write_study
from tests.support.studies import trained_study
from tests.support.studies.fake_study import write_config

without_gpu = pytest.mark.skipif(torch.cuda.is_available(), reason="there is a CUDA device")


@without_gpu
@pytest.mark.parametrize("command", ["run", "plan"])
def test_a_gpu_that_is_not_there_is_one_line_and_exit_code_2(tmp_path, command, monkeypatch, capsys):
    output = tmp_path / "out"
    code = holoeval(monkeypatch, command, write_config(tmp_path), "--output", output, "--device", "cuda")
    printed = capsys.readouterr()
    assert (code, printed.out, printed.err.count("\n"), output.exists()) == (2, "", 1, False)
    assert printed.err.startswith("holoeval: --device cuda: torch ")


@without_gpu
@pytest.mark.usefixtures("no_physics")
def test_auto_is_the_cpu_where_there_is_no_gpu_and_is_told(tmp_path, monkeypatch):
    config = trained_study.write(tmp_path)
    assert trained_study.holoeval(monkeypatch, config, "--device", "auto") == 0
    known = provenance.read(tmp_path / "out")
    assert (known["device"], "gpu" in known) == ("cpu", False)
    made = trained_study.needs(config)[0]
    assert "device" not in trained_study.Artifacts(tmp_path / "artifacts").load(made).provenance


@pytest.mark.usefixtures("no_physics")
def test_the_provenance_has_the_gpu_and_so_has_the_report(tmp_path):
    config = write_config(tmp_path, count=1)
    assert compute(config, tmp_path / "out").provenance["device"] == "cpu"
    study = load_study(config)
    found = provenance.describe(study, plan(study), tmp_path, 1, 1, "cuda", "Some GPU")
    assert (found["device"], found["gpu"]) == ("cuda", "Some GPU")
    assert ("GPU", "Some GPU") in environment(found)
    assert "GPU" not in dict(environment(provenance.describe(study, plan(study), tmp_path, 1, 1)))


def test_the_seconds_of_a_gpu_are_kept_apart_and_those_of_the_cpu_where_they_were(tmp_path):
    task = planned(write_config(tmp_path)).tasks[-1]
    assert len({cost.key(task, 1, 1, gpu) for gpu in ("", "one GPU", "another GPU")}) == 3
    assert cost.key(task, 1, 1) == cost.key(task, 1, 1, "")


def test_a_gpu_is_told_to_repeat_itself_and_to_keep_single_precision(monkeypatch):
    monkeypatch.delenv("CUBLAS_WORKSPACE_CONFIG", raising=False)
    monkeypatch.setattr(torch.backends.cudnn, "allow_tf32", True)
    with repeatable(1, CPU):
        assert "CUBLAS_WORKSPACE_CONFIG" not in os.environ
        assert torch.backends.cudnn.allow_tf32
    with repeatable(1, torch.device("cuda")):
        assert os.environ["CUBLAS_WORKSPACE_CONFIG"] == ":4096:8"
        assert not torch.backends.cudnn.allow_tf32
        assert torch.are_deterministic_algorithms_enabled()
    monkeypatch.delenv("CUBLAS_WORKSPACE_CONFIG")


def test_there_are_as_many_workers_as_gpus_unless_asked_otherwise():
    assert executor("auto", None, gpus=1) == Serial()
    assert executor("auto", None, small=False, gpus=4) == Local(4, 4)
    assert executor("local", None, gpus=1) == Local(1, 1)
    assert executor("local", 3, gpus=2) == Local(3, 2)
    assert executor("serial", None, gpus=2) == Serial()
    assert executor("local", 2) == Local(2)


@pytest.mark.parametrize(("seen", "expected"), [(None, ["0", "1", "0"]), ("2,5", ["2", "5", "2"])])
def test_every_worker_sees_one_gpu(seen, expected, monkeypatch):
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    if seen is not None:
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", seen)
    assert [one_gpu(number, 2) for number in range(3)] == expected


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
@pytest.mark.slow
def test_a_study_on_a_gpu_has_the_scores_of_the_cpu(tmp_path):
    methods = ("wirtinger", "oracle", "{name: online_camera, params: {captures: 40}}")
    config = write_study(tmp_path / "study.yaml", *methods, display="{profiles: [leto-aged], panel: [192, 192]}")
    scores = {}
    for device in ("cpu", "cuda"):
        outcome = compute(config, tmp_path / device, device=device)
        assert outcome.failed == 0
        scores[device] = [record["scores"]["psnr_linear"] for record in outcome.records]
        assert outcome.provenance["device"] == device
    assert outcome.provenance["gpu"] == torch.cuda.get_device_name()
    assert scores["cuda"] == pytest.approx(scores["cpu"], abs=0.5)  # dB, behind a camera with noise
