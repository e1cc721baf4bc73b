"""The command that installs a package keeps to the pinned versions, in a clone and where a wheel is installed."""

import shlex
from pathlib import Path

import pytest

from holobench_eval.core import installed
from holobench_eval.core.installed import as_typed, clone, installing, shipped_configs


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
