"""A method or a dataset costs a file and an entry point, in this package as in any other that is installed."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from holobench_eval.commands.list_ import KINDS, list_
from holobench_eval.core import plugins
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan

METHOD = '''
from dataclasses import dataclass


@dataclass(frozen=True)
class Flat:
    """A constant phase."""

    phase: float = 0.0

    def solve(self, target, bench): ...
'''
DATASET = '''
from dataclasses import dataclass


@dataclass(frozen=True)
class Grays:
    """Two images of one level each."""

    def items(self):
        return ["dark", "bright"]

    def digest(self, item):
        return item

    def load(self, item, shape, channels=3): ...
'''
ENTRY_POINTS = """\
[holobench_eval.methods]
flat = made_elsewhere.flat:Flat
[holobench_eval.datasets]
grays = made_elsewhere.grays:Grays
"""


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A package with a method and a dataset, as pip leaves it."""
    package, described = tmp_path / "made_elsewhere", tmp_path / "made_elsewhere-1.dist-info"
    for folder in (package, described):
        folder.mkdir()
    for name, text in {"__init__": "", "flat": METHOD, "grays": DATASET}.items():
        (package / f"{name}.py").write_text(text)
    (described / "METADATA").write_text("Metadata-Version: 2.1\nName: made-elsewhere\nVersion: 1\n")
    (described / "entry_points.txt").write_text(ENTRY_POINTS)
    monkeypatch.syspath_prepend(tmp_path)
    plugins._entries.cache_clear()
    yield
    plugins._entries.cache_clear()
    for name in [name for name in sys.modules if name.startswith("made_elsewhere")]:
        del sys.modules[name]


@pytest.mark.usefixtures("installed")
def test_a_file_and_an_entry_point_can_be_named_in_a_study(tmp_path: Path) -> None:
    assert "flat" in plugins.names("methods")
    assert "grays" in plugins.names("datasets")
    (tmp_path / "study.yaml").write_text(
        'title: "Mine"\ndisplay: {profiles: [ideal], panel: [192, 192]}\ntargets: {dataset: grays}\n'
        "methods: [{name: flat, params: {phase: 0.5}}]\n"
    )
    cells = [cell for cell in plan(load_study(tmp_path / "study.yaml")).cells if cell.method == "flat"]
    assert [(cell.target, cell.params) for cell in cells] == [("dark", {"phase": 0.5}), ("bright", {"phase": 0.5})]
    assert len(cells[0].code) == 64  # code from elsewhere is named by its hash


@pytest.mark.usefixtures("installed")
def test_what_is_listed_of_it_is_told_by_a_process_that_imports_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert ("flat", "A constant phase.") in list(KINDS["methods"][0]())
    list_("flat")
    assert "phase = 0.0   (number)" in capsys.readouterr().out
    assert "made_elsewhere.flat" not in sys.modules
