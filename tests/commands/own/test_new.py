import runpy
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
import torch

from holobench_eval.commands import app
from holobench_eval.commands.own.new import write_code
from holobench_eval.core import plugins
from holobench_eval.core.errors import UserError
from holobench_eval.display import load_profile
from holobench_eval.study.opening import open_bench

KINDS = dict.fromkeys(("method", "captures", "trains"), "keeps_the_contract")
KINDS |= dict.fromkeys(("camera", "panel"), "can_be_measured_with")


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_new_is_clean_and_passes_its_own_test(kind, tmp_path):
    _, test, _ = write_code("quiet_phase", tmp_path / "mine", kind)
    runpy.run_path(str(test))[f"test_quiet_phase_{KINDS[kind]}"]()
    ruff = [sys.executable, "-m", "ruff", "check", "--isolated", "--line-length", "120", str(tmp_path)]
    # in a folder where the package is not the user's own
    done = subprocess.run(ruff, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stdout


def test_a_new_method_gets_nearer_to_its_target_with_every_step(tmp_path):
    _, _, named = write_code("quiet_phase", tmp_path)
    assert named == f"{tmp_path}/quiet_phase.py:QuietPhase"
    bench = open_bench(load_profile("ideal"), (64, 64), seed=0)
    region = bench.spec.region
    target = torch.linspace(0, 1, region.width).expand(1, 1, *region.shape).clone()

    def error(iterations: int) -> float:
        method = plugins.build("methods", named, {"iterations": iterations})
        handle = bench.for_method(method, "new", target[0], item="ramp", repeat=0)
        phase = method.solve(target, handle)[0, 0]
        image = region.crop(bench.spec.propagator(0).forward((1j * phase).exp())).abs().square()
        scale = (image * target[0, 0]).sum() / image.square().sum()
        return float((scale * image - target[0, 0]).square().mean())

    assert error(60) < error(10) < error(1)


STUDY = """\
title: Methods that have just been written
display: {profiles: [leto-2020], panel: [144, 144]}
targets: {dataset: photographs, params: {names: [coffee]}}
training: {params: {count: 7}, held_out: 1}
protocol: {metrics: [psnr]}
methods:
  - {name: wirtinger, params: {iterations: 50}}
  - {name: "sees.py:Sees", label: limited, captures: 8, params: {captures: 20}}
  - {name: "learns.py:Learns", label: learned}
"""


def test_new_methods_that_capture_or_learn_run_in_a_study_and_gain_by_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_code("sees", tmp_path, "captures")
    write_code("learns", tmp_path, "trains")
    Path("study.yaml").write_text(STUDY)
    app(["run", "study.yaml", "--executor", "serial"], standalone_mode=False)
    rows = pd.read_csv("holoeval-results/study/records.csv").set_index("label")
    assert list(rows.loc[["wirtinger", "limited", "learned"], "captures"]) == [0, 8, 0]
    assert rows.loc["learned", "training_captures"] == 6 + 1
    assert (rows.loc[["limited", "learned"], "psnr_linear_db"] > rows.loc["wirtinger", "psnr_linear_db"]).all()


def test_existing_files_are_never_overwritten(tmp_path):
    (tmp_path / "test_quiet_phase.py").write_text("mine")
    with pytest.raises(UserError, match="exists already"):
        write_code("quiet_phase", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["test_quiet_phase.py"]
    assert (tmp_path / "test_quiet_phase.py").read_text() == "mine"


@pytest.mark.parametrize("name", ["", "2fast", "Quiet", "a-b", "../a", "class", "a.b", "_x", "é", "random", "torch"])
def test_names_that_are_no_modules_or_would_hide_one_are_refused(tmp_path, name):
    with pytest.raises(UserError, match="would hide" if name in ("random", "torch") else "is no name for a module"):
        write_code(name, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be written"):
        write_code("quiet_phase", tmp_path / "file" / "folder")
