import json
import os
import shutil
import subprocess
import sys
from importlib.metadata import version
from io import BytesIO, TextIOWrapper
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
import torch
from PIL import Image

from holobench_eval import commands
from holobench_eval.commands import main, options
from holobench_eval.commands.run import _is_finished, _panel, draw_sheets, replaced, sheets
from holobench_eval.report.charts import sheet as charts
from holobench_eval.study import opening
from holobench_eval.study import plan as planning
from holobench_eval.study.config import load_study
from holobench_eval.study.running import provenance
from tests.support.studies.fake_study import write_config

PLUGIN = """
import torch

def blind(target, bench):
    return torch.full((*target.shape[:2], *bench.spec.shape), torch.nan)
"""

CONFIG = """\
title: Command line
display: {profiles: [ideal], panel: [128, 128]}
targets: {dataset: charts, params: {names: [gray_ramp]}}
protocol: {metrics: [psnr, ssim]}
methods: [double_phase, "blind.py:blind"]
"""


@pytest.fixture
def config(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "blind.py").write_text(PLUGIN)
    path = tmp_path / "toy.yaml"
    path.write_text(CONFIG)
    return path


def holoeval(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """The exit code of a command."""
    monkeypatch.setattr(sys, "argv", ["holoeval", *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        main()
    code = stopped.value.code
    return code if isinstance(code, int) else 0


@pytest.mark.parametrize("by", ["numpy", "torch"])
def test_memory_that_is_used_up_is_one_line(monkeypatch, call, by):
    def full(**_: str) -> None:
        np.empty(2**60, np.uint8) if by == "numpy" else torch.empty(2**60, dtype=torch.uint8)

    monkeypatch.setattr("holobench_eval.commands.app", full)
    line = "holoeval: out of memory; what is finished is kept, run the same command with more\n"
    assert call("list") == (2, "", line)


def test_a_plan_without_a_folder_of_trained_methods_says_where_a_clone_has_them(tmp_path, monkeypatch, call):
    def is_said(method: str) -> bool:
        code, printed, _ = call("plan", "table3", "--methods", method)
        assert code == 0
        return "A clone of the repository has what the shipped studies need in its folder artifacts" in printed

    monkeypatch.chdir(tmp_path)
    assert not is_said("hil")  # these tests run in one
    monkeypatch.setattr(options, "clone", lambda: None)
    assert is_said("hil")
    assert not is_said("wirtinger")


@pytest.mark.slow
def test_a_study_from_run_to_check(config, call):
    folder, another = Path("holoeval-results/toy"), config.with_name("another.yaml")

    def tables() -> list[bytes]:
        return [(folder / name).read_bytes() for name in ("table.csv", "records.csv")]

    code, printed, _ = call("plan", config)
    assert (code, folder.parent.exists(), "missing" in printed) == (0, False, True)

    code, printed, _ = call("run", config, "--executor", "serial", "--threads", 1)
    assert code == 1
    assert [
        word for word in ("1 cell failed", "double_phase", "1 failed (blind on ideal): ") if word not in printed
    ] == []
    assert (folder / "report.md").exists()
    before = tables()
    assert b"blind,open loop,{},,,,,0,1," in before[0]
    assert b"values that are NaN or infinite" in before[1]

    shutil.rmtree(folder / "figures", ignore_errors=True)
    assert call("report", config)[0] == 0
    assert call("figure", config, "--for", "column", "--into", "printed")[0] == 0
    assert not Path("printed").exists()  # no method has a difference to draw
    another.write_text(f"{config.read_text()}\nseed: 99\n")
    code, _, error = call("report", another, "--output", folder)
    assert (code, "no cell of this study has a record here" in error) == (2, True)
    assert tables() == before

    assert call("check", "holoeval-results")[0] == 0
    (folder / "table.csv").write_text("changed")
    code, printed, _ = call("check", "holoeval-results")
    assert (code, "1 report, 1 problem" in printed) == (1, True)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "absent.yaml"), "absent.yaml: no such file in "),
        (("run", "toy.yaml", "--executor", "lokal"), "unknown executor 'lokal'; did you mean 'local'?"),
        (("run", "toy.yaml", "--output", "toy.yaml/out"), ": Not a directory\n"),
        (("report", "toy.yaml"), "no records in this folder"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(config, call, arguments, message):
    code, out, err = call(*arguments)
    assert (code, out, err[:10], err.count("\n"), "Errno" in err) == (2, "", "holoeval: ", 1, False)
    assert message in err


@pytest.mark.parametrize(
    "arguments",
    [
        ("solve", "wirtinger", "my.png", "--display", "ideal", "--panel", 5000, 5000),
        ("twin", "ideal", "-o", "lab", "--panel", 5000, 5000),
        ("show", "ideal", "--panel", 5000, 5000),
        ("run", "toy.yaml", "--set", "display.panel=[5000, 5000]"),
        ("plan", "toy.yaml", "--set", "display.panel=[5000, 5000]"),
    ],
)
def test_a_panel_that_the_display_does_not_have_is_one_line_and_leaves_nothing(config, call, arguments):
    Image.new("RGB", (40, 30)).save("my.png")
    before = {path for path in config.parent.rglob("*") if path.is_file()}
    code, _, error = call(*arguments)
    assert (code, error.count("\n")) == (2, 1)
    assert error.endswith("the panel of 'ideal' has 1080 x 1920 pixels, not [5000, 5000]; give at most these\n")
    assert {path for path in config.parent.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize(
    ("arguments", "file"),
    [
        (("run", "loop.yaml"), "loop.yaml"),
        (("solve", "wirtinger", "loop.png"), "loop.png"),
        (("solve", "wirtinger", "my.png", "--display", "loop.yaml"), "loop.yaml"),
        (("solve", "wirtinger", "my.png", "--output", "loop"), "loop/picture"),
        (("solve", "loop.py:f", "my.png"), "loop.py"),
        (("plan", "toy.yaml", "--set", "methods=['loop.py:f']"), "loop.py"),
        (("plan", "toy.yaml", "--set", "methods=[{name: phases, params: {file: loop.png}}]"), "loop.png"),
        (("plan", "toy.yaml", "--set", "targets={dataset: folder, params: {path: loop}}"), "loop"),
        (("plan", "toy.yaml", "--set", "targets={dataset: folder, params: {path: .}}"), "loop.png"),
        (("list", "loop.yaml"), "loop.yaml"),
    ],
)
def test_a_link_that_leads_back_to_itself_is_one_line_that_names_it(config, call, arguments, file):
    Image.new("RGB", (40, 30)).save("my.png")
    for name in ("loop", "loop.yaml", "loop.png", "loop.py"):
        Path(name).symlink_to(name)
    code, _, error = call(*arguments)
    assert (code, error.count("\n")) == (2, 1)
    assert file in error


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (OSError(30, "Read-only file system", "out"), "out: Read-only file system"),
        (OSError(28, "No space left on device", "from", None, "to"), "to: No space left on device"),
        (OSError(28, "No space left on device"), "[Errno 28] No space left on device"),
        (OSError("a driver's own"), "a driver's own"),
    ],
)
def test_a_refusal_of_the_system_begins_with_the_place(monkeypatch, call, error, line):
    monkeypatch.setattr("holobench_eval.commands.app", Mock(side_effect=error))
    assert call("list") == (2, "", f"holoeval: {line}\n")


def test_a_mistake_in_a_config_or_an_option_leaves_nothing_behind(config, call):
    for option in ("--threads", "--workers"):
        assert call("run", config, "--executor", "local", option, "0")[0] == 2
    config.write_text(CONFIG.replace("panel", "pannel"))
    code, _, error = call("run", config)
    assert (code, Path("holoeval-results").exists()) == (2, False)
    assert f"{config}:2:30: unknown key 'pannel' in display; did you mean 'panel'?" in error


def test_what_is_new_is_written_and_named(config, call):
    for kind, name, printed in (
        ("method", "quiet_phase", "mine/quiet_phase.py:QuietPhase"),
        ("display", "my-display", "mine/my-display.yaml"),
        ("camera", "my_camera.py", "camera: {driver: mine/my_camera.py:MyCamera}"),
        ("panel", "my_panel", "slm: {driver: mine/my_panel.py:MyPanel}"),
    ):
        code, said, _ = call("new", kind, name, "--folder", "mine")
        assert (code, printed in said) == (0, True)
        assert call("new", kind, name, "--folder", "mine")[0] == 2
    assert call("new-method", "closer", "--camera")[0] == 0  # as it was called once
    assert call("new", "panel", "other", "--camera")[0] == 2


def test_a_new_command_is_one_file_and_one_line(tmp_path):
    package = tmp_path / "holobench_eval"
    shutil.copytree(Path(commands.__file__).parents[1], package, ignore=shutil.ignore_patterns("__pycache__"))
    folder = package / "commands"
    (folder / "greet_all.py").write_text('def greet_all() -> None:\n    """Greet everybody."""\n    print("hello")\n')
    text = (folder / "__init__.py").read_text()
    (folder / "__init__.py").write_text(text.replace('    "plan",\n', '    "plan",\n    "greet_all",\n'))

    def output(*arguments: str) -> str:
        call = [sys.executable, "-c", "from holobench_eval.commands import main; main()", *arguments]
        environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
        done = subprocess.run(call, capture_output=True, text=True, check=True, env=environment, cwd=tmp_path)
        return done.stdout

    lines = [line.split() for line in output("--help").splitlines()]
    names = [line[0] for line in lines if line]
    assert names[names.index("plan") :][:3] == ["plan", "greet-all", "run"]
    assert ["greet-all", "Greet", "everybody."] in lines
    assert output("greet-all") == "hello\n"


def test_the_help_lists_commands_in_the_order_of_work_a_line_each(monkeypatch, call):
    monkeypatch.setenv("COLUMNS", "80")
    lines = call("-h")[1].partition("A study:\n")[2].splitlines()
    entries = [line.split(maxsplit=1) for line in lines[:-1] if line.startswith("  ")]
    names = [words[0] for words in entries]
    assert names[:4] == ["configs", "list", "plan", "run"]
    assert sorted(names) == sorted(every_command())
    assert all(len(words) == 2 and words[1].endswith(".") and "..." not in words[1] for words in entries)
    assert max(map(len, lines)) <= 80


def every_command() -> list[str]:
    """Names of commands, and of groups of commands."""
    return [str(entry.name) for entry in (*commands.app.registered_commands, *commands.app.registered_groups)]


@pytest.mark.parametrize("command", [*every_command(), "session export"])
def test_every_command_explains_itself(call, command):
    code, printed, _ = call(*command.split(), "-h")
    assert (code, f"Usage: holoeval {command}" in printed) == (0, True)


@pytest.mark.parametrize("arguments", [(), ("run",), ("session", "export")])
def test_the_version_is_that_of_the_package(call, arguments):
    assert call(*arguments, "--version")[:2] == (0, f"holoeval {version('holobench_eval')}\n")


def test_help_needs_no_heavy_import():
    code = "import sys, holobench_eval.commands\n"
    code += "print(sorted({'torch', 'numpy', 'pydantic', 'dask'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_display_is_shown_with_its_effects_and_what_the_parametric_model_lacks(config, monkeypatch, call):
    monkeypatch.setattr(charts, "draw_sheet", lambda *_: Path("stages.png"))
    _, table, _ = call("show", "leto-dusty")
    shown = {line.split()[1]: line for line in table.splitlines() if line.startswith("│")}
    assert "has it" in shown["look_up_table"]
    assert "lacks it" in shown["plane_dust"]


def test_signs_that_a_terminal_lacks_stop_nothing(monkeypatch, tmp_path):
    narrow = TextIOWrapper(BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stderr", narrow)
    assert holoeval(monkeypatch, "run", str(tmp_path / "Ω·.yaml")) == 2
    narrow.seek(0)
    assert "holoeval: " in narrow.read()


@pytest.fixture
def drawn(monkeypatch):
    """What sheets have been drawn from; no bench is opened."""
    sources: list[str] = []
    monkeypatch.setattr(opening, "simulated", lambda display, seed: SimpleNamespace())
    monkeypatch.setattr(charts, "save_sheet", lambda bench, note, path, source: sources.append(source))
    return sources


def sheet(folder: Path):
    (found,) = sheets(load_study(write_config(folder)), folder)
    return found


def test_a_sheet_that_is_there_is_not_drawn_again(tmp_path, drawn, monkeypatch):
    wanted = sheet(tmp_path)
    wanted()
    own = tmp_path / "figures" / "stages-ideal.png"
    monkeypatch.setattr(charts, "drawn_from", lambda path: drawn[0] if path == own else "")
    wanted()
    assert len(drawn) == 1


def test_a_sheet_that_cannot_be_drawn_is_a_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(opening, "simulated", lambda display, seed: 1 / 0)
    draw_sheets([sheet(tmp_path)], threads=1)
    assert capsys.readouterr().err == "holoeval: no stage sheet of ideal: division by zero\n"


def test_the_panel_of_a_config_is_known_before_it_is_checked(tmp_path):
    study = load_study(write_config(tmp_path))
    assert _panel(study.file) == study.display.panel
    others = "{profiles: [ideal]}", "[", "3", "{panel: large}", "{panel: [.inf, 64]}"
    for text in ("3", *(f"display: {other}" for other in others)):
        (tmp_path / "other.yaml").write_text(text)
        assert _panel(tmp_path / "other.yaml") is None
    assert _panel(tmp_path / "missing.yaml") is None


def test_a_study_is_finished_when_its_last_run_ended_and_its_config_is_still_the_same(tmp_path):
    study, output = load_study(write_config(tmp_path)), tmp_path / "out"
    assert not _is_finished(study.file, output)
    described = provenance.begin(output, provenance.describe(study, planning.plan(study), output, 1, 1), resumed=False)
    assert not _is_finished(study.file, output)
    provenance.end(output, described)
    assert _is_finished(study.file, output)
    study.file.write_text(study.text + "# changed\n")
    assert not _is_finished(study.file, output)


def test_a_report_of_another_config_is_not_replaced_without_a_word(tmp_path):
    study = load_study(write_config(tmp_path))
    assert replaced(study, tmp_path) == ""
    (tmp_path / "report.md").write_text("")
    own, other = {"config_sha256": provenance.text_digest(study.text)}, {"config_sha256": "0"}
    for known, said in (
        *((own, ""), (other, "is of another or an edited config")),
        (other | {"changes": {"limit": 2}}, "was run with --limit 2"),
    ):
        (tmp_path / "provenance.json").write_text(json.dumps(known | {"earlier": []}))
        assert said in replaced(study, tmp_path)
        assert bool(said) == bool(replaced(study, tmp_path))
