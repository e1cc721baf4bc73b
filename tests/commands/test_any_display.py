"""Every command that takes a display or a study works on one laser or three, one bit or eight, and any panel."""

from __future__ import annotations

import inspect
from itertools import product
from pathlib import Path
from typing import Any

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
panel: {{wavelengths: {wavelengths}, shape: {shape}, distance: 0.009, pitch: 8.0e-6, bits: {bits}}}
"""
STUDY = """\
title: On any display
display: {{profiles: [mine.yaml], panel: {shape}}}
targets: {{dataset: charts, params: {{names: [tv_lines]}}}}
methods: [double_phase]
protocol: {{metrics: [psnr]}}
"""
ONE, THREE = [5.32e-7], [6.38e-7, 5.2e-7, 4.5e-7]
SQUARE, ODD = [128, 128], [119, 131]
# every pair of colours, bits and shape
DISPLAYS = [(ONE, 1, ODD), (ONE, 8, SQUARE), (THREE, 1, SQUARE), (THREE, 8, ODD)]
TAKEN = {"profile", "display", "config"}  # parameters by which a command is told a display


def commands(group: typer.Typer = app, *words: str) -> Any:
    """The words and the function of every command that takes a display, in the order of work."""
    for info in group.registered_commands:
        name = info.name or info.callback.__name__.rstrip("_")
        if TAKEN & set(inspect.signature(info.callback).parameters) or name == "list":
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


@pytest.mark.parametrize("display", DISPLAYS, ids=lambda each: f"{len(each[0])} x {each[1]} bits, {each[2]}")
def test_every_command_that_takes_a_display_works_on_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, display: tuple[list[float], int, list[int]]
) -> None:
    monkeypatch.chdir(tmp_path)
    wavelengths, bits, shape = display
    Path("mine.yaml").write_text(PROFILE.format(wavelengths=wavelengths, bits=bits, shape=shape))
    Path("study.yaml").write_text(STUDY.format(shape=shape))
    Image.fromarray(data.astronaut()[::2, ::2]).save("picture.png")
    for words, function in COMMANDS:
        done = CliRunner().invoke(app, [*words, *arguments(words, function, tmp_path, shape)])
        refusal = "is not fitted to anything" if words == ("calibrate",) else ""
        refusal = "patterns are written with 8" if words == ("session", "export") and bits != 8 else refusal
        assert (refusal in str(done.exception)) if refusal else done.exit_code == 0, (
            words,
            done.output,
            done.exception,
        )
    assert Path("sheet.png").is_file()
    assert {path.parts[0] for path in Path().glob("**/figures/*stages*.png")} == {"solved", "holoeval-results"}


def test_the_displays_hold_every_pair_of_their_properties_and_the_commands_are_all() -> None:
    for first, second in ((0, 1), (0, 2), (1, 2)):
        pairs = [(str(each[first]), str(each[second])) for each in DISPLAYS]
        assert set(pairs) == set(product(*map(set, zip(*pairs, strict=True))))
    assert {"show", "solve", "plan", "run", "list", "session export"} <= {" ".join(words) for words, _ in COMMANDS}
