"""One revision against another: what the verdict says, and that two processes really take turns with two packages."""

import re
import subprocess
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


HERE, THERE = "here", "there"


class Timed:
    """A process that takes given seconds a call, or gives a reason why it cannot; ``asked``: names and requests."""

    def __init__(self, place="", seconds=0.2, fault=None, ended=False):
        self.place, self.seconds, self.fault, self.ended, self.asked = place, seconds, fault, ended, []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def ask(self, name, request):
        self.asked.append((name, request))
        if self.fault is not None and name == self.fault:
            raise LookupError(f"no {name}")
        return {"seconds": self.seconds(len(self.asked)) if callable(self.seconds) else self.seconds}


@pytest.fixture
def started(monkeypatch):
    """The processes that a comparison starts, in their order, with places and seeds; ``make`` decides what they do."""
    begun = SimpleNamespace(workers=[], seeds=[], make=lambda place: Timed(place, 0.3 if place == HERE else 0.2))

    def worker(folder, layouts=0):
        begun.seeds.append(layouts)
        begun.workers.append(begun.make(folder.name))
        return begun.workers[-1]

    monkeypatch.setattr(against, "worker", worker)
    monkeypatch.setattr(against, "_lay_out", lambda *_: None)
    monkeypatch.setattr(against, "_extract", lambda *_: None)
    monkeypatch.setattr(against, "SECONDS", 0.0)
    return begun


def test_a_slower_working_tree_has_a_ratio_above_one_and_each_version_is_first_as_often(started):
    steps = []
    found = against.against("HEAD", ["a", "b"], lambda *step: steps.append(step))
    assert [(one.case, one.verdict) for one in found] == [("a", "slower"), ("b", "slower")]
    assert found[0].ratio == pytest.approx(1.5)
    first = [worker.place for worker in started.workers[::2]]
    assert first.count(HERE) == first.count(THERE) == against.STARTS / 2
    assert started.seeds[::2] == started.seeds[1::2]  # arrays lie alike in both versions, and elsewhere in each start
    assert len(set(started.seeds)) == against.STARTS
    assert steps == [
        (case, 2 * start + place, 2 * against.STARTS) for start in range(8) for place, case in enumerate("ab")
    ]


def test_a_case_that_one_version_lacks_is_told_and_the_others_are_compared(started):
    started.make = lambda place: Timed(place, fault="a" if place == THERE else None)
    lacking, compared = against.against("HEAD", ["a", "b"], lambda *_: None)
    assert (lacking.verdict, lacking.reason) == ("not in both", "no a")
    assert compared.verdict == "unchanged"


def test_a_process_that_ends_takes_no_other_case_with_it(started):
    started.make = lambda place: Timed(place, fault="a", ended=len(started.workers) < 2)
    lacking, compared = against.against("HEAD", ["a", "b"], lambda *_: None)
    assert lacking.verdict == "not in both"
    assert compared.verdict == "unchanged"
    assert not any(name == "b" for worker in started.workers[:2] for name, _ in worker.asked)


def test_disturbed_turns_do_not_count(monkeypatch):
    monkeypatch.setattr(against, "SECONDS", 60.0)
    here = Timed(HERE, lambda call: 5.0 if call in (4, 9) else 0.2)
    assert against._ratio("case", here, Timed(THERE), Random(1)) == 0
    assert len(here.asked) == 2 + against.MOST


def test_short_calls_are_repeated_within_a_turn_and_long_ones_are_not():
    for seconds, calls in ((0.001, 30), (0.1, 2), (1.0, 1)):
        here = Timed(HERE, seconds)
        against._ratio("case", here, Timed(THERE, seconds), Random(1))
        assert {request for _, request in here.asked[2:]} == {calls}


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


@pytest.mark.slow
def test_a_slower_copy_is_seen_and_imported_from_its_own_folder(tmp_path):
    """The worker times the package of its folder: one with a sleep in the propagation takes longer by the sleep."""
    here, there = tmp_path / "here", tmp_path / "there"
    for place in (here, there):
        against._lay_out(suite.CHECKOUT, place)
    file = here / "holobench_eval" / "optics" / "convolution.py"
    text = file.read_text()
    line = "        if tuple(field.shape[-2:]) != self.shape:\n"
    assert line in text
    file.write_text(text.replace(line, "        __import__('time').sleep(1)\n" + line))
    case = "propagation, 256x256, 20 mm | holobench_eval"
    seconds = []
    for place in (here, there):
        with against.worker(place) as worker:
            seconds.append(worker.ask(case, 1)["seconds"])
    assert seconds[0] >= 1 > seconds[1]


@pytest.mark.slow
def test_what_a_version_lacks_is_not_taken_from_another(tmp_path):
    """Without the allocator's settings an older version is timed as it is; without anything else it gives a reason."""
    against._lay_out(suite.CHECKOUT, tmp_path)
    package = tmp_path / "holobench_eval"
    (package / "core" / "allocator.py").unlink()
    case = "propagation, 256x256, 20 mm | holobench_eval"
    lacking = pytest.raises(LookupError, match=r"No module named 'holobench_eval\.core\.allocator'")
    with against.worker(tmp_path) as worker, lacking:
        worker.ask(case, 1)
    for user, line in (
        ("optics/transfer.py", "LARGEST_KEPT = 2**25"),
        ("core/device.py", "keep_freed_memory = int"),
        ("study/folders/scoring.py", "return_large_arrays = int"),
        ("study/cost.py", "give_back_freed_memory = int"),
    ):
        text, lines = re.subn(r"from \.+(core\.)?allocator import .*", line, (package / user).read_text())
        assert lines == 1
        (package / user).write_text(text)
    with against.worker(tmp_path) as worker:
        assert worker.ask(case, 1)["seconds"] > 0


def test_cases_that_are_compared_by_default_exist():
    assert set(against.COMPARED) <= {case.name for case in suite.cases("|")}


def test_the_benchmarks_of_an_installed_package_are_missed_in_one_line(monkeypatch, tmp_path):
    monkeypatch.setattr(suite, "CHECKOUT", tmp_path)
    with pytest.raises(UserError, match=r"no benchmarks in .*; in a checkout: pip install"):
        against.against("HEAD", [], print)
