"""What is made of the answers of the processes: a timing a version, and a reason where there is none."""

import pytest

from holobench_eval.benchmarks import measure, suite
from holobench_eval.benchmarks.suite import Case, MissingError

STEP, METRIC = "gradient step", "metric"
CASES = [Case(STEP, "ours", True), Case(STEP, "another", True), Case(STEP, "absent", True), Case(METRIC, "psnr", False)]


class Timed:
    """A process that takes 1 s where its heap is fresh and 0.5 s where it is steady, half that for another's step."""

    def __init__(self, *options, cache, heap):
        self.steady, self.heap, self.sent, self.names = "--steady" in options, heap, [], set()
        started.append(self)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def send(self, name, request):
        self.sent.append((name, request))

    def receive(self):
        return self.ask(*self.sent[-1])

    def ask(self, name, request):
        self.names.add(name)
        if "absent" in name:
            raise MissingError("No module named 'jax'", "jax")
        if "broken" in name:
            raise LookupError("it broke")
        if request == "memory":
            return {"bytes": 10 if self.steady else 20}
        if request == "facts":
            return {"facts": {"padded": [8, 9], "error": 0.1}}
        return {"seconds": (0.5 if self.steady else 1.0) / (1 + ("another" in name)), "faults": 0 if self.steady else 7}


started = []


@pytest.fixture
def measured(monkeypatch):
    def fix(cases):
        started.clear()
        monkeypatch.setattr(measure, "Worker", Timed)
        monkeypatch.setattr(measure, "cases", lambda only: cases)
        for name in ("FRESH_SECONDS", "STEADY_SECONDS", "SHARED_SECONDS"):
            monkeypatch.setattr(measure, name, 1e-9)
        steps = []
        return measure.measure("", lambda *step: steps.append(step)), steps

    return fix


def test_a_version_that_is_compared_has_times_and_memory_of_both_heaps(measured):
    timings = {row.version: row for row in measured(CASES)[0].timings}
    ours, another = timings["ours"], timings["another"]
    assert (ours.median_s, ours.fresh_s, another.median_s, another.fresh_s) == (0.5, 1.0, 0.25, 0.5)
    assert (ours.memory_bytes, ours.fresh_memory_bytes, ours.faults, ours.fresh_faults) == (10, 20, 0, 7)
    assert (ours.rows, ours.columns, ours.error, ours.rounds) == (8, 9, 0.1, measure.FEWEST)
    assert timings["psnr"].fresh_s is None
    assert timings["psnr"].median_s == 0.5


def test_each_compared_version_has_processes_of_its_own_and_steady_ones_a_steady_heap(measured):
    measured(CASES)
    steady, reference, fresh, shared = started[:3], started[3], started[4:7], started[7]
    assert [process.names for process in steady + fresh] == 2 * [{case.name} for case in CASES[:3]]
    assert [process.steady for process in started] == [True, True, True, False, False, False, False, True]
    assert reference.names == {CASES[0].name}
    assert shared.names == {CASES[3].name}
    assert all(process.heap == (suite.STEADY if process.steady else {}) for process in started)


def test_what_is_not_installed_is_no_fault_and_what_breaks_is(measured):
    found, _ = measured([*CASES, Case(METRIC, "broken", False)])
    assert found.missing == {"jax": ["absent"]}
    assert found.faults == {"metric | broken": "it broke"}
    assert [row.version for row in found.timings] == ["ours", "another", "psnr"]


def test_a_version_keeps_its_process_for_all_distances(measured):
    other = [Case("gradient step, elsewhere", case.version, True) for case in CASES[:2]]
    assert len(measured([*CASES[:2], *other])[0].timings) == 4
    assert len(started) == 2 * 2 + 1  # and one for the reference


def test_progress_is_in_seconds_of_turns(measured):
    _, steps = measured(CASES)
    assert [(name, pytest.approx(done * 1e9), pytest.approx(total * 1e9)) for name, done, total in steps] == [
        (STEP, 0, 7),
        (METRIC, 6, 7),
    ]
