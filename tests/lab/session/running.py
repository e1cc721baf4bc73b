"""Commands as a test runs them, those of a session above all."""

from pathlib import Path

from typer.testing import CliRunner

from holobench_eval.commands import app
from holobench_eval.core.errors import UserError
from tests.study.studies import write_study


def run(*words: object) -> tuple[str, str]:
    """What ``holoeval`` says, and the one line with which it ends; empty where it succeeds."""
    done = CliRunner().invoke(app, list(map(str, words)))
    assert done.exit_code == 0 or isinstance(done.exception, UserError), (done.output, done.exception)
    assert "\n" not in str(done.exception)
    return done.output, str(done.exception or "")


def succeed(*words: object) -> str:
    """What ``holoeval`` says where it succeeds."""
    said, failure = run(*words)
    assert not failure, failure
    return said


def told(*words: object) -> tuple[str, str]:
    """As ``run``, of ``holoeval session``."""
    return run("session", *words)


def exported(folder: Path, methods: str, profile: str, *options: object, panel: int = 144) -> Path:
    """The session folder of a study of one photograph."""
    config = write_study(
        folder / "study.yaml", methods, display=f"{{profiles: [{profile}], panel: [{panel}, {panel}]}}"
    )
    succeed("session", "export", config, folder / "bench", *options)
    return folder / "bench"
