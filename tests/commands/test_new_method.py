from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from holobench_eval.commands.new_method import write_method
from holobench_eval.core import plugins
from holobench_eval.core.errors import UserError
from holobench_eval.display import load_profile
from holobench_eval.study.opening import open_bench


def test_a_new_method_passes_its_own_test(tmp_path: Path) -> None:
    _, test, _ = write_method("quiet_phase", tmp_path / "mine")
    runpy.run_path(str(test))["test_quiet_phase_keeps_the_contract"]()


def test_a_new_method_gets_nearer_to_its_target_with_every_step(tmp_path: Path) -> None:
    _, _, named = write_method("quiet_phase", tmp_path)
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


def test_a_new_method_is_clean(tmp_path: Path) -> None:
    write_method("quiet_phase", tmp_path)
    done = subprocess.run(
        [sys.executable, "-m", "ruff", "check", "--isolated", "--line-length", "120", str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def test_existing_files_are_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "test_quiet_phase.py").write_text("mine")
    with pytest.raises(UserError, match="exists already"):
        write_method("quiet_phase", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["test_quiet_phase.py"]
    assert (tmp_path / "test_quiet_phase.py").read_text() == "mine"


@pytest.mark.parametrize("name", ["", "2fast", "Quiet", "a-b", "../a", "class", "a.b", "a b", "_x", "é"])
def test_names_that_are_no_modules_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(UserError, match="is no name for a method"):
        write_method(name, tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["random", "torch"])
def test_a_name_that_would_hide_a_module_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(UserError, match="would hide"):
        write_method(name, tmp_path)


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be written"):
        write_method("quiet_phase", tmp_path / "file" / "folder")
