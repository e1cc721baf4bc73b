"""Methods from files, and the command that installs a package."""

import functools
import gc
import os
import shlex
import sys
import weakref
from pathlib import Path

import pytest

from holobench_eval.core import installed, plugins
from holobench_eval.core.errors import UserError
from holobench_eval.core.installed import as_typed, clone, installing, shipped_configs

METHOD = """
import dataclasses

asked = []

@dataclasses.dataclass
class Mine:
    number: int = {number}

    def solve(self, target, bench):
        asked.append(target)
        return len(asked)
"""


def test_what_a_file_remembers_does_not_reach_the_next_cell_and_its_classes_are_not_kept(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(METHOD.format(number=1))
    built = []
    for _ in range(4):
        method = plugins.build("methods", "mine.py:Mine", {}, tmp_path)
        assert method.solve(None, None) == 1
        built.append(weakref.ref(type(method)))
    del method
    gc.collect()
    assert [one() is None for one in built[:-1]] == [True] * 3  # the last is that of the module in use


def test_equal_files_in_two_folders_are_two_modules(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "mine.py").write_text(METHOD.format(number=1))
    first, second = (plugins.find("methods", "mine.py:Mine", tmp_path / name) for name in ("a", "b"))
    assert first is not second


def test_a_file_that_was_edited_is_imported_again_and_never_from_bytecode(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    file = tmp_path / "mine.py"
    for number in (1, 2):  # equal size and equal time, which is all that bytecode is checked by
        file.write_text(METHOD.format(number=number))
        os.utime(file, (1e9, 1e9))
        assert plugins.build("methods", "mine.py:Mine", {}, tmp_path).number == number


ABOUT_ITSELF = """
from __future__ import annotations

from dataclasses import InitVar, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from nowhere import Nothing

HOME = Path(__file__).parents[1]

@dataclass
class Mine:
    steps: tuple[int, ...] = ()
    start: InitVar[int] = 2
    cache: ClassVar[Nothing]

    def __post_init__(self, start):
        self.begun = start

    def solve(self, target, bench):
        return HOME
"""


def test_a_file_knows_where_it_lies_and_has_lists_and_init_variables(tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "mine.py").write_text(ABOUT_ITSELF)
    monkeypatch.chdir(tmp_path / "inner")
    method = plugins.build("methods", "mine.py:Mine", {"steps": [1, 2], "start": 5})
    assert method.solve(None, None) == tmp_path
    assert (method.steps, method.begun) == ((1, 2), 5)


def test_a_function_that_is_set_on_a_method_is_called_without_the_method(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("def f(target, bench): ...\nf.files = lambda name: [f'{name}.npy']\n")
    assert plugins.build("methods", "mine.py:f", {}, tmp_path).files("cat") == ["cat.npy"]
    with pytest.raises(UserError, match=r"method 'mine\.py': a file without its class; expected mine\.py:Class"):
        plugins.find("methods", "mine.py", tmp_path)


@pytest.mark.parametrize(
    ("parameter", "message"),
    [
        ("a", "method 'mine.py:f': parameter 'a' needs an annotation or a default"),
        ("a: float", "method 'mine.py:f' needs the parameter 'a'"),
        ("*args", "method 'mine.py:f': '*args' takes any parameters; name each of them"),
    ],
)
def test_a_parameter_that_no_config_can_set_is_refused_in_one_line(tmp_path: Path, parameter, message) -> None:
    (tmp_path / "mine.py").write_text(f"def f(target, bench, {parameter}): ...\n")
    with pytest.raises(UserError) as found:
        plugins.build("methods", "mine.py:f", {}, tmp_path)
    assert str(found.value) == message


@pytest.mark.parametrize(
    "text",
    [
        "def f(bench, target, gamma=1.0): ...\n",
        "import dataclasses\n@dataclasses.dataclass\nclass f:\n    def solve(self, bench, target): ...\n",
    ],
)
def test_a_method_that_takes_its_arguments_in_the_other_order_is_refused_when_it_is_loaded(tmp_path, text) -> None:
    (tmp_path / "mine.py").write_text(text)
    with pytest.raises(UserError, match=r"'mine.py:f' takes bench and target in this order; expected \(target, bench"):
        plugins.find("methods", "mine.py:f", tmp_path)


def test_a_parameter_that_came_later_is_in_no_name_while_it_has_its_default() -> None:
    own = {"file": "a.png", "two_pi_level": 200}
    assert "correction" not in plugins.params_of(plugins.build("methods", "phases", own, None))
    given = {**own, "correction": {"file": "flat.bmp"}}
    assert plugins.params_of(plugins.build("methods", "phases", given, None))["correction"]["file"] == "flat.bmp"


def test_a_method_that_turns_anothers_arguments_round_is_no_swapped_one() -> None:
    def theirs(bench: object, target: object) -> object:
        return bench

    @functools.wraps(theirs)
    def ours(target: object, bench: object) -> object:
        return theirs(bench, target)

    plugins.refuse_swapped(ours, "ours")
    with pytest.raises(UserError, match="theirs takes bench and target"):
        plugins.refuse_swapped(theirs, "theirs")


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a space that holds the studies of a package, as a wheel installs it."""
    configs = tmp_path / "the place" / "configs"
    configs.mkdir(parents=True)
    (configs / "constraints.txt").touch()
    monkeypatch.setattr(installed, "shipped", lambda: configs)
    monkeypatch.chdir(tmp_path)
    return configs.parent


def test_of_a_wheel_the_constraints_that_travel_with_it_are_named(place: Path) -> None:
    constraints = place / "configs" / "constraints.txt"
    assert clone() is None
    assert shlex.split(installing(extra="peers")) == ["pip", "install", "-c", str(constraints), "holobench_eval[peers]"]
    assert shlex.split(installing("kornia")) == ["pip", "install", "-c", str(constraints), "kornia"]
    assert shlex.split(installing())[-1] == "holobench_eval"


def test_in_a_clone_the_command_is_that_of_the_documentation(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("pyproject.toml", "constraints.txt"):
        (place / name).touch()
    assert clone() == place
    constraints = ["-c", str(place / "constraints.txt")]
    assert shlex.split(installing(extra="peers")) == ["pip", "install", *constraints, "-e", f"{place}[peers]"]
    monkeypatch.chdir(place)
    assert installing(extra="peers") == "pip install -c constraints.txt -e '.[peers]'"
    assert installing("kornia") == "pip install -c constraints.txt kornia"
    assert installing() == "pip install -c constraints.txt -e ."


def test_a_config_that_ships_is_typed_by_its_name_and_another_by_its_path() -> None:
    assert as_typed(shipped_configs()["table3"]) == "table3"
    assert as_typed(Path("elsewhere/table3.yaml")) == "elsewhere/table3.yaml"
