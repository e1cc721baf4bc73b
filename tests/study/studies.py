"""Small studies for tests: a config in a few words, and texts with pieces exchanged."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.core.errors import CellError, UserError
from holobench_eval.study.config import load_study
from holobench_eval.study.executors import Executor, Serial
from holobench_eval.study.plan import Plan, Task, plan
from holobench_eval.study.running.progress import Lines
from holobench_eval.study.running.run import Outcome, run
from tests.support.studies.fake_study import install

MILD, TWO = "{profiles: [leto-mild], panel: [128, 160]}", "{dataset: photographs, params: {count: 2}}"


def write_study(path: Path, *methods: str, **entries: str) -> Path:
    """A config: of one photograph on a small ideal display, scored by PSNR, unless its entries, as YAML, say else."""
    given = {
        "title": "small",
        "display": "{profiles: [ideal], panel: [128, 160]}",
        "targets": "{dataset: photographs, params: {count: 1}}",
        "protocol": "{metrics: [psnr]}",
        "methods": f"[{', '.join(methods)}]",
    }
    path.write_text("".join(f"{key}: {text}\n" for key, text in (given | entries).items()))
    return path


def write_green(folder: Path, like: str) -> Path:
    """The file ``green.yaml`` of a display with one laser, for what is the same in every colour."""
    path = folder / "green.yaml"
    panel = "panel: {wavelengths: [5.17e-7]}"
    path.write_text(f"name: green\nversion: 1\ndescription: One laser.\nlike: {like}\n{panel}\n")
    return path


def write_ideal_green(folder: Path, name: str, effect: str = "") -> None:
    """The file of a display of one laser that is ideal but for an effect, as YAML says it."""
    panel = (
        "shape: [128, 128], pitch: 6.4e-6, wavelengths: [5.17e-7], distance: 0.02, bits: 8, pupil: 0.8, region: 0.8125"
    )
    head = f"name: {name}\nversion: 1\nseed: 0\ndescription: Ideal but for an effect.\n"
    (folder / f"{name}.yaml").write_text(f"{head}panel: {{{panel}}}\n{effect}\n")


def exchanged(text: str, *changes: tuple[str, str]) -> str:
    """A text with pieces exchanged, each of which it has."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text


@contextmanager
def one_line(*words: str, at: str = "") -> Iterator[None]:
    """What comes is refused in one line that begins with a place and holds the words."""
    with pytest.raises((UserError, CellError)) as refused:
        yield
    line = str(refused.value)
    assert line.startswith(at), line
    assert [word for word in words if word not in line] == [], line
    assert "\n" not in line


def assert_refused(config: Path, message: str) -> None:
    """A config is refused in one line that begins with its place, as the message does, and the reason."""
    with one_line(at=f"{config}:{message}"):
        load_study(config)


def planned(config: Path) -> Plan:
    """What a config plans."""
    return plan(load_study(config))


def tasks_of(config: Path) -> dict[str, list[Task]]:
    """The tasks of every method of a study, by its label."""
    tasks: dict[str, list[Task]] = {}
    for task in planned(config).tasks:
        tasks.setdefault(task.label, []).append(task)
    return tasks


def write_ideal(path: Path, *changes: tuple[str, str]) -> None:
    """The ideal profile in a file, with pieces exchanged."""
    text = files("holobench_eval.display.simulated").joinpath("profiles", "ideal.yaml").read_text()
    path.write_text(exchanged(text, *changes))


def add_other_profile(folder: Path) -> None:
    write_ideal(folder / "other.yaml", ("name: ideal", "name: other"))


def add_one_laser(folder: Path) -> None:
    add_other_profile(folder)
    laser = ("[6.36e-7, 5.17e-7, 4.46e-7]", "[5.32e-7]")
    write_ideal(folder / "one.yaml", ("name: ideal", "name: one"), laser)


TURNS = Serial(workers=2)
"""Says that it has two workers; what they compute takes turns."""


def compute_faked(config: Path, output: Path) -> None:
    """Run a study with the fakes, in a process that a test kills."""
    install()
    compute(config, output)


def compute(
    config: Path,
    output: Path,
    write: Callable[[str], None] = lambda line: None,
    executor: Executor | None = None,
    grid: Plan | None = None,
    artifacts: Path | None = None,
    **options: Any,
) -> Outcome:
    """Run a study, or a plan of it that was made before; what is trained lies beside the output folder unless said."""
    study, trained = load_study(config), artifacts or output.parent / "artifacts"
    return run(study, grid or plan(study), output, executor or Serial(), Lines(write), 1, trained, **options)
