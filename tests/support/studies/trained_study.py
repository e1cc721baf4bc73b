"""Studies with the fake trained methods: their configs, their runs, and what a command line says of them."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.study.artifacts import Artifacts
from holobench_eval.study.displays import Preparation
from holobench_eval.study.running.run import Outcome
from tests.commands import test_commands
from tests.study import studies
from tests.study.studies import exchanged, planned
from tests.support.studies import fake_trained

CONFIG = """\
title: "Trained"
seed: 3
display: {profiles: [ideal], panel: [128, 128]}
targets: {dataset: "trained.py:Pictures", params: {count: 1}}
training: {dataset: "trained.py:Unseen", held_out: 1}
methods: ["trained.py:Gain"]
"""


INSIDE = ("seed: 3", "seed: 3\nisolation: none")
"""Where what runs in a process of its own is no matter, which takes longer."""


def write(folder: Path, *changes: tuple[str, str]) -> Path:
    """A config and the plug-ins it names, with pieces of the config exchanged."""
    shutil.copy(fake_trained.__file__, folder / "trained.py")
    path = folder / "study.yaml"
    path.write_text(exchanged(CONFIG, *changes))
    return path


def write_inside(folder: Path, *changes: tuple[str, str]) -> Path:
    """The same of a study whose methods run inside."""
    return write(folder, INSIDE, *changes)


def compute(config: Path, output: str = "out", write: Callable[[str], None] = print, **options: Any) -> Outcome:
    """Run a study in this process; artifacts are beside its config."""
    folder = config.parent
    return studies.compute(config, folder / output, write, artifacts=folder / "artifacts", **options)


def computed(config: Path) -> list[dict[str, Any]]:
    """The records of a study, all done, for several tests: its timings are beside it, not in the cache of one test."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(config.parent / "cache"))
        records = compute(config).records
    assert {record["state"] for record in records} == {"done"}, [record["reason"] for record in records]
    return records


def needs(config: Path) -> list[Preparation]:
    """What has to be learned for a study."""
    return list(planned(config).preparations().values())


def artifact_of(config: Path) -> Path:
    """The folder of the one artifact of a study."""
    (needed,) = needs(config)
    return Artifacts(config.parent / "artifacts").folder_of(needed)


def rounds(folder: Path) -> list[int]:
    """Every round of training that was begun."""
    log = folder / "rounds.txt"
    return [int(line) for line in log.read_text().split()] if log.exists() else []


def holoeval(patch: pytest.MonkeyPatch, config: Path, *options: str) -> int:
    """The exit code of ``holoeval run``."""
    folder = config.parent
    places = "--output", folder / "out", "--artifacts", folder / "artifacts"
    return test_commands.holoeval(patch, "run", config, "--executor", "serial", *places, *options)


def assert_refused(code: int, printed: Any, *words: str) -> None:
    """A command ended with one line that holds the words, and with exit code 2."""
    assert code == 2
    assert printed.err.startswith("holoeval: ")
    assert printed.err.count("\n") == 1
    assert all(word in printed.err for word in words), printed.err
    assert "Traceback" not in printed.out
