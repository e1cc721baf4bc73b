"""A stranger's file: what is inferred from it, and what is refused in one line."""

from pathlib import Path

import pytest
import typer

from holobench_eval.commands.own.conformance import conformance
from holobench_eval.core.errors import UserError
from holobench_eval.testing.propagator import BAND, load_subject
from tests.study.studies import one_line

EXAMPLES = Path(__file__).parents[2] / "docs" / "propagators"
GOOD = "def make(shape, pitch, wavelength, distance):\n    return lambda field: field\n"


@pytest.fixture
def write(tmp_path):
    def written(text):
        (tmp_path / "mine.py").write_text(text)
        return f"{tmp_path / 'mine.py'}:make"

    return written


def test_claims_are_those_of_the_file_or_else_exact_and_nearly_the_whole_band(write):
    plain = load_subject(write(GOOD))
    assert (plain.physics, plain.band) == ("exact", BAND)
    claiming = load_subject(write(GOOD + "make.physics, make.band = 'paraxial', 1\n"))
    assert (claiming.physics, claiming.band) == ("paraxial", 1.0)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("import nothing_of_this_name", "fails to import: ModuleNotFoundError"),
        ("raise SystemExit", "fails to import: SystemExit"),
        ("made = 1", "has no class or function 'make'"),
        ("make = 1", "has no class or function 'make'"),
        ("class Make: pass", "did you mean 'Make'?"),
        ("def make(shape): pass", "cannot be called as make(shape, pitch, wavelength, distance)"),
        (GOOD + "make.physics = 'fresnel'", "allowed: exact, paraxial"),
        (GOOD + "make.physics = []", "allowed: exact, paraxial"),
        (GOOD + "make.band = 0", "not a share in (0, 1]"),
        (GOOD + "make.band = 'all'", "not a share in (0, 1]"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_in_one_line(write, text, says):
    source = write(text)
    with one_line(says):
        load_subject(source)


@pytest.mark.parametrize("source", ["mine.py", "mine.py:", ":Mine", "mine.txt:Mine", "mine.py:not a name"])
def test_what_is_no_file_and_name_is_refused(source):
    with pytest.raises(UserError, match=r"path/to/file\.py:Name"):
        load_subject(source)


def test_a_file_that_is_not_there_is_refused():
    with pytest.raises(UserError, match="no such file"):
        load_subject("nowhere.py:Mine")


def exit_code(source):
    with pytest.raises(typer.Exit) as left:
        conformance(source)
    return left.value.exit_code


def test_the_example_of_the_docs_passes_every_check(capsys):
    assert exit_code(f"{EXAMPLES / 'mine.py'}:MyPropagator") == 0
    assert "12 passed, 0 failed, 0 not applicable" in capsys.readouterr().out


def test_the_example_of_a_mistake_fails_as_the_docs_say(capsys):
    assert exit_code(f"{EXAMPLES / 'half_bin.py'}:HalfBin") == 1
    out = capsys.readouterr().out
    assert "6 passed, 6 failed, 0 not applicable" in out
    assert max(len(line) for line in out.splitlines()[1:]) <= 100
