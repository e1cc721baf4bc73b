"""The commands of a session, as a test runs them."""

from pathlib import Path

from typer.testing import CliRunner

from holobench_eval.commands import app
from holobench_eval.core.errors import UserError


def told(*words: object) -> tuple[str, str]:
    """What ``holoeval session`` says, and the one line with which it ends; empty where it succeeds."""
    done = CliRunner().invoke(app, ["session", *map(str, words)])
    assert done.exit_code == 0 or isinstance(done.exception, UserError), (done.output, done.exception)
    assert "\n" not in str(done.exception)
    return done.output, str(done.exception or "")


def exported(folder: Path, study: str, *options: object) -> Path:
    """The session folder of a study, given as text."""
    (folder / "study.yaml").write_text(study)
    _, failure = told("export", folder / "study.yaml", folder / "bench", *options)
    assert not failure, failure
    return folder / "bench"
