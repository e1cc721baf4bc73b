"""Every command that takes a display or a study works on one laser, one bit and a panel of odd sides."""

import inspect
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import pytest
import typer
from PIL import Image
from skimage import data
from typer.testing import CliRunner

from holobench_eval.commands import app

PROFILE = """\
name: mine
version: 1
seed: 1
description: A panel of any kind.
like: ideal
panel: {{wavelengths: [6.38e-7, 5.2e-7, 4.5e-7], shape: {shape}, distance: 0.009, pitch: 8.0e-6, bits: {bits}}}
"""
STUDY = """\
title: On any display
display: {{profiles: [mine.yaml], panel: {shape}}}
targets: {{dataset: charts, params: {{names: [tv_lines]}}}}
methods: [double_phase]
protocol: {{metrics: [psnr]}}
"""
PANEL = [119, 131]  # of three lasers and one bit; with eight bits they are those of other tests
TAKEN = {"profile", "display", "config"}  # parameters by which a command is told a display
APART = {"twin"}  # it learns for minutes: its models are tried on such displays in tests/methods/twin


def commands(group: typer.Typer = app, *words: str) -> Any:
    """The words and the function of every command that takes a display, in the order of work."""
    for info in group.registered_commands:
        name = info.name or info.callback.__name__.rstrip("_")
        if name not in APART and (TAKEN & set(inspect.signature(info.callback).parameters) or name == "list"):
            yield (*words, name), info.callback
    for info in group.registered_groups:
        yield from commands(info.typer_instance, *words, info.name)


COMMANDS = list(commands())


def arguments(words: tuple[str, ...], function: Any, folder: Path, panel: list[int]) -> list[str]:
    """What a command is given: a value for each argument that it needs, and for the options that say a display."""
    given = {"profile": "mine.yaml", "config": "study.yaml", "name": "mine.yaml", "picture": "picture.png"}
    given |= {"methods": "double_phase", "folder": "session"}
    options = {"display": ["mine.yaml"], "panel": [str(side) for side in panel], "output": ["out"]}
    if "config" in inspect.signature(function).parameters:
        options = {}  # it names the display, and a folder for its results
    values = []
    for name, parameter in inspect.signature(function).parameters.items():
        if name in options:
            where = {"show": ["sheet.png"], "solve": ["solved"]}.get(words[-1], options[name])
            values += [f"--{name}", *(where if name == "output" else options[name])]
        elif name == "medium":
            values += ["--for", "column"]
        elif parameter.default is inspect.Parameter.empty or (name == "name" and words[-1] == "list"):
            values.append(given[name])
    return values


@pytest.mark.usefixtures("in_process", "stage_sheets")
def test_every_command_that_takes_a_display_works_on_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("study.yaml").write_text(STUDY.format(shape=PANEL))
    Image.fromarray(data.astronaut()[::2, ::2]).save("picture.png")
    for words, function in COMMANDS:
        bits = 8 if words == ("session", "export") else 1  # patterns are written with 8
        Path("mine.yaml").write_text(PROFILE.format(shape=PANEL, bits=bits))
        done = CliRunner().invoke(app, [*words, *arguments(words, function, tmp_path, PANEL)])
        assert done.exit_code == 0, (words, done.output, done.exception)
    assert Path("sheet.png").is_file()
    assert {path.parts[0] for path in Path().glob("**/figures/*stages*.png")} == {"holoeval-results"}
    assert any("figures/stages" in name for name in ZipFile("solved/study.zip").namelist())


def test_the_commands_are_all_that_take_a_display():
    assert {"show", "solve", "plan", "run", "list", "session export"} <= {" ".join(words) for words, _ in COMMANDS}
