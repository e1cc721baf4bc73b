"""One revision against another: what the verdict says, and that two processes really take turns with two packages."""

import math
import re
import subprocess
from collections import Counter
from contextlib import contextmanager
from pathlib import Path
from random import Random
from types import SimpleNamespace

import pytest

from holobench_eval.benchmarks import against, suite
from holobench_eval.core.errors import UserError


@pytest.mark.parametrize(
    ("logarithms", "verdict"),
    [
        ([0.2, 0.21, 0.19, 0.2, 0.22, 0.18, 0.2], "slower"),
        ([-0.2, -0.21, -0.19, -0.2, -0.22, -0.18, -0.2], "faster"),
        ([0.02, 0.021, 0.019, 0.02, 0.022, 0.018, 0.02], "unchanged"),  # certain, and too small to matter
        ([0.5, -0.4, 0.3, -0.2, 0.6, -0.3, 0.1], "unchanged"),  # large, and not certain
    ],
)
def test_a_verdict_needs_certainty_and_size(logarithms, verdict):
    found = against.judge("case", logarithms, cases=5)
    assert found.verdict == verdict
    assert found.lower < found.ratio < found.upper


def test_each_version_is_started_first_as_often_as_the_other(monkeypatch):
    first = {"a": [], "b": []}
    monkeypatch.setattr(against, "_lay_out", lambda *_: None)
    monkeypatch.setattr(against, "_extract", lambda *_: None)
    monkeypatch.setattr(against, "_start", lambda case, *rest: first[case].append(rest[2]) or len(first[case]) / 100)
    assert [one.case for one in against.against("HEAD", list(first), lambda *_: None)] == ["a", "b"]
    for starts in first.values():
        assert sum(starts) == len(starts) / 2 == against.STARTS / 2


HERE, THERE = Path("here"), Path("there")


@pytest.fixture
def started(monkeypatch):
    """Processes that take 0.3 s a call here and 0.2 s there; the places and seeds they were started with."""
    begun = []

    @contextmanager
    def worker(place, layouts):
        begun.append((place, layouts))
        yield SimpleNamespace(place=place, kill=lambda: None)

    monkeypatch.setattr(against, "worker", worker)
    monkeypatch.setattr(against, "_timed", lambda one, *_: 0.3 if one.place == HERE else 0.2)
    return begun


@pytest.mark.parametrize("here_first", [True, False])
def test_a_slower_working_tree_has_a_ratio_above_one_whichever_is_started_first(started, here_first):
    assert math.exp(against._start("case", HERE, THERE, here_first, Random(1))) == pytest.approx(1.5)
    assert [place for place, _ in started] == ([HERE, THERE] if here_first else [THERE, HERE])
    assert len({layouts for _, layouts in started}) == 2


def test_disturbed_turns_do_not_count(started, monkeypatch):
    turns = Counter()

    def timed(one, *_):
        turns[one.place] += 1
        return 5.0 if one.place == HERE and turns[HERE] in (4, 9) else 0.2

    monkeypatch.setattr(against, "_timed", timed)
    assert against._start("case", HERE, THERE, True, Random(1)) == 0


def test_more_cases_widen_every_interval():
    logarithms = [0.1, 0.12, 0.08, 0.11, 0.09, 0.1, 0.1]
    one, many = (against.judge("case", logarithms, cases) for cases in (1, 50))
    assert one.lower > many.lower
    assert one.upper < many.upper


@pytest.fixture
def repository(tmp_path, monkeypatch):
    """A checkout with one commit."""
    folder = tmp_path / "repository"
    folder.mkdir()
    (folder / "file").write_text("text\n")
    author = ["-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "commit.gpgsign=false"]
    for command in (["init", "-q"], ["add", "file"], [*author, "commit", "-q", "-m", "a [/] in its message"]):
        subprocess.run(["git", *command], cwd=folder, check=True)
    monkeypatch.setattr(against, "CHECKOUT", folder)
    return folder


@pytest.mark.parametrize("revision", ["no-such-revision", "", "-h", "--list", "--output=file", "^HEAD", "HEAD:file"])
def test_an_unknown_revision_is_one_line_and_never_an_option(repository, tmp_path, revision):
    with pytest.raises(UserError, match=f"--against {re.escape(revision)}: no such commit"):
        against._extract(revision, tmp_path / "extracted")
    assert (repository / "file").read_text() == "text\n"


@pytest.mark.parametrize("revision", ["HEAD", "HEAD^{/[/]}", ":/in its"])
def test_whatever_names_a_commit_is_a_revision(repository, tmp_path, revision):
    extracted = against._extract(revision, tmp_path / "extracted")
    assert (extracted / "file").read_text() == "text\n"


def test_a_revision_without_its_packages_is_one_line(tmp_path):
    (tmp_path / "pyproject.toml").write_text('[tool.setuptools.package-dir]\nholobench_eval = "holobench_eval"\n')
    with pytest.raises(UserError, match="has no folder holobench_eval, which its pyproject"):
        against._lay_out(tmp_path, tmp_path / "out")


def test_without_git_there_is_nothing_to_compare_with(tmp_path, monkeypatch):
    monkeypatch.setattr(against, "CHECKOUT", tmp_path)
    with pytest.raises(UserError, match="needs a git checkout"):
        against._extract("HEAD", tmp_path)


class Replies:
    """A worker that answers with given seconds."""

    def __init__(self, replies):
        self.replies, self.asked = iter(replies), []
        self.stdin = self.stdout = self

    def write(self, text):
        self.asked.append(text)

    def flush(self):
        pass

    def readline(self):
        return next(self.replies, "")


def test_a_worker_that_cannot_do_the_case_gives_its_reason():
    with pytest.raises(LookupError, match="KeyError: no such case"):
        against._timed(Replies(['{"error": "KeyError: no such case"}\n']), "case", 1)
    with pytest.raises(LookupError, match="the process ended"):
        against._timed(Replies([]), "case", 1)
    worker = Replies(['{"seconds": 0.5}\n'])
    assert against._timed(worker, "a case", 3) == 0.5
    assert worker.asked == ["a case\t3\n"]


@pytest.mark.slow
def test_a_slower_copy_is_seen_and_imported_from_its_own_folder(tmp_path):
    """The worker times the package of its folder: one with a sleep in the propagation takes longer by the sleep."""
    here, there = tmp_path / "here", tmp_path / "there"
    for place in (here, there):
        against._lay_out(suite.CHECKOUT, place)
    file = here / "holobench_eval" / "optics" / "convolution.py"
    text = file.read_text()
    assert "    height, width = field.shape[-2:]\n" in text
    sleeping = "    __import__('time').sleep(1)\n    height, width = field.shape[-2:]\n"
    file.write_text(text.replace("    height, width = field.shape[-2:]\n", sleeping, 1))
    case = "propagation, 256x256, 7 mm | holobench_eval"
    seconds = []
    for place in (here, there):
        with against.worker(place) as worker:
            seconds.append(against._timed(worker, case, 1))
    assert seconds[0] >= 1 > seconds[1]


@pytest.mark.slow
def test_what_a_version_lacks_is_not_taken_from_another(tmp_path):
    """Without the allocator's settings an older version is timed as it is; without anything else it gives a reason."""
    against._lay_out(suite.CHECKOUT, tmp_path)
    package = tmp_path / "holobench_eval"
    (package / "core" / "allocator.py").unlink()
    case = "propagation, 256x256, 7 mm | holobench_eval"
    lacking = pytest.raises(LookupError, match=r"No module named 'holobench_eval\.core\.allocator'")
    with against.worker(tmp_path) as worker, lacking:
        against._timed(worker, case, 1)
    for user, line in (
        ("optics/convolution.py", "LARGEST_KEPT = 2**25"),
        ("core/device.py", "keep_freed_memory = int"),
    ):
        text, lines = re.subn(r"from \.(\.core\.)?allocator import .*", line, (package / user).read_text())
        assert lines == 1
        (package / user).write_text(text)
    with against.worker(tmp_path) as worker:
        assert against._timed(worker, case, 1) > 0


def test_cases_that_are_compared_by_default_exist():
    names = suite.names("|")
    assert set(against.COMPARED) <= set(names)
    with pytest.raises(UserError, match="no benchmark's name holds 'nothing of the kind'"):
        suite.names("nothing of the kind")


def test_every_case_has_a_name_of_its_own():
    names = suite.names("|")
    assert len(names) == len(set(names))


def test_the_benchmarks_of_an_installed_package_are_missed_in_one_line(monkeypatch, tmp_path):
    monkeypatch.setattr(suite, "CHECKOUT", tmp_path)
    for call in (suite.suite, lambda: suite.measure(None), lambda: against.against("HEAD", [], print)):
        with pytest.raises(UserError, match=r"no benchmarks in .*; in a checkout: pip install"):
            call()


def test_a_plain_install_is_told_what_benchmarks_need(monkeypatch):
    monkeypatch.setattr(suite, "find_spec", lambda name: None)
    with pytest.raises(UserError, match=r"pytest-benchmark is not installed.*'\.\[dev\]'"):
        suite.measure(None)


def test_peak_memory_counts_what_is_held():
    group = "propagation, 256x256, 7 mm"
    held = suite.peak_memory(suite.Timing(group, "holobench_eval", 1, 1, 1, 1))
    assert held is None or 0 < held < 2**31
