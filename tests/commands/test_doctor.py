import json
import shlex
from pathlib import Path
from types import SimpleNamespace

import pytest
import typer

from holobench_eval.commands import doctor as module
from holobench_eval.commands.doctor import Finding, _ask, doctor, examine
from holobench_eval.core.installed import installed, installing, pinned
from tests.support.patience import PATIENCE

DEVICES = [
    {"kind": "slm", "driver": "monitor", "version": "2.1", "devices": ["HDMI-2, 1920x1080"], "why": ""},
    {"kind": "slm", "driver": "slmsuite", "version": None, "devices": [], "why": "pip install 'x[slmsuite]'"},
    {"kind": "camera", "driver": "gphoto2", "version": "2.6", "devices": [], "why": "none answers; is it on?"},
]


@pytest.fixture
def quick(monkeypatch, tmp_path):
    """Nothing is imported or asked in other processes; there are no weights."""
    monkeypatch.setenv("TORCH_HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)

    def answer(code, seconds, *arguments):
        return DEVICES if "drivers" in code else {"errors": {}, "threads": 2, "gpus": []}

    monkeypatch.setattr(module, "_ask", answer)
    return monkeypatch


def exit_code():
    with pytest.raises(typer.Exit) as stopped:
        doctor()
    return stopped.value.exit_code


def named(findings, what):
    return next(each for each in findings if each.what == what)


def test_this_installation_has_all_that_the_core_needs(capsys):
    code, said = exit_code(), capsys.readouterr().out
    assert code == 0, said


def test_devices_and_what_keeps_them_from_answering_are_listed(quick):
    findings = examine()
    assert all(each.remedy for each in findings if each.state != "ok")
    assert not [each for each in findings if "docs/" in each.found + each.remedy]  # which a wheel lacks
    assert named(findings, "panels: monitor") == Finding("panels: monitor", "ok", "2.1; HDMI-2, 1920x1080")
    absent, silent = named(findings, "panels: slmsuite"), named(findings, "cameras: gphoto2")
    assert (absent.state, absent.remedy) == ("missing", "pip install 'x[slmsuite]'")
    assert (silent.state, silent.found) == ("missing", "2.6; no device answers")


def test_a_machine_without_the_compiler_gets_one_line_and_is_not_broken(quick):
    fault = {"errors": {}, "threads": 2, "gpus": [], "kernel": "ModuleNotFoundError: No module named 'numba'"}
    quick.setattr(module, "_ask", lambda code, *_: DEVICES if "drivers" in code else fault)
    (line,) = (each for each in examine() if "numba" in each.what + each.found + each.remedy)
    assert (line.what, line.state, line.remedy) == ("propagation", "missing", installing("numba"))


def test_versions_that_differ_from_the_pinned_ones_are_told_with_the_constraints_that_ship(quick):
    assert "numpy" in pinned()
    quick.setattr(module, "pinned", lambda: {"numpy": "0.1"})
    found = named(examine(), "versions")
    assert (found.state, found.found) == ("warning", f"numpy {installed('numpy')} (not 0.1)")
    assert Path(shlex.split(found.remedy)[3]).is_file()
    quick.setattr(module, "pinned", dict)
    assert "cannot be compared" in named(examine(), "versions").found


def test_what_pip_gets_is_in_the_pinned_versions(quick):
    quick.setattr(module, "installed", lambda name: None)
    findings = examine()
    commands = [named(findings, what).remedy for what in ("peer odak", "peer torchoptics", "camera RAW files")]
    assert commands == [installing(extra="peers")] * 2 + [installing(extra="raw")]
    assert all(Path(shlex.split(command)[3]).is_file() for command in commands)


def test_weights_that_are_absent_are_one_command_away(quick, tmp_path):
    absent = named(examine(), "LPIPS weights (AlexNet)")
    place = tmp_path / "hub" / "checkpoints" / "alexnet-owt-7be5be79.pth"
    assert absent.state == "missing"
    assert absent.remedy.startswith(f"curl -L --create-dirs -o {place} https://")
    place.parent.mkdir(parents=True)
    place.touch()
    assert named(examine(), "LPIPS weights (AlexNet)") == Finding("LPIPS weights (AlexNet)", "ok", str(place))


def test_commands_are_printed_whole_for_copying(quick, capsys):
    quick.setenv("COLUMNS", "60")
    assert exit_code() == 0
    assert "panels: slmsuite: pip install 'x[slmsuite]'" in capsys.readouterr().out.splitlines()


def test_a_package_that_cannot_be_imported_is_broken_and_exits_1(quick, capsys):
    errors = {"kornia": "ImportError: no symbol"}
    quick.setattr(module, "_ask", lambda code, *_: DEVICES if "drivers" in code else {"errors": errors})
    assert named(examine(), "kornia") == Finding("kornia", "broken", errors["kornia"], installing("kornia"))
    assert exit_code() == 1
    assert capsys.readouterr().out.splitlines()[-1] == "broken: kornia"


def test_the_wheel_with_windows_is_a_warning_since_it_overwrites_the_headless_one(quick):
    versions = {"opencv-python": "5.0", "opencv-python-headless": "5.0"}
    quick.setattr(module, "installed", versions.get)
    found = named(examine(), "OpenCV")
    assert found.state == "warning"
    assert found.remedy.startswith("pip uninstall -y opencv-python-headless opencv-python && pip install -c ")


def test_a_full_disk_no_git_and_a_check_that_fails_are_told(quick):
    quick.setattr(module.shutil, "disk_usage", lambda path: SimpleNamespace(free=1e8))
    quick.setattr(module.shutil, "which", lambda program: None)
    findings = examine()
    assert [named(findings, what).state for what in ("disk", "git")] == ["warning", "missing"]
    quick.setattr(module.shutil, "disk_usage", lambda path: {}["odd\nmachine"])
    found = named(examine(), "disk")
    assert (found.state, found.found) == ("warning", "could not be looked at: KeyError: 'odd\\nmachine'")


def test_what_hangs_is_cut_off_and_what_crashes_is_told():
    assert _ask("import time; time.sleep(10_000)", 1.0) == "takes longer than 1 s"
    assert str(_ask("import os; os.abort()", PATIENCE)).startswith("ends with -6")
    assert _ask("raise SystemExit('no bus')", PATIENCE) == "ends with 1: no bus"
    assert _ask(f"print('chatter'); print({json.dumps([1, 2])!r})", 20.0) == [1, 2]


def test_drivers_that_crash_cost_one_line_and_no_exit_code(quick):
    quick.setattr(module, "_ask", lambda code, *_: "ends with -11: x" if "drivers" in code else {"errors": {}})
    assert named(examine(), "drivers").state == "warning"
    assert exit_code() == 0
