"""The processes that time benchmarks, and the turns that they take."""

from random import Random

import pytest

from holobench_eval.benchmarks import suite
from holobench_eval.core.errors import UserError

CASE = "propagation, 256x256, 20 mm | holobench_eval"


@pytest.fixture
def worker(tmp_path):
    with suite.Worker("--steady", "1", cache=tmp_path) as process:
        yield process


def test_every_case_has_a_name_of_its_own():
    names = [case.name for case in suite.cases("|")]
    assert len(names) == len(set(names))


def test_what_no_benchmark_is_called_is_one_line():
    with pytest.raises(UserError, match="no benchmark's name holds 'nothing of the kind'"):
        suite.cases("nothing of the kind")


def test_the_benchmarks_of_an_installed_package_are_missed_in_one_line(monkeypatch, tmp_path):
    monkeypatch.setattr(suite, "CHECKOUT", tmp_path)
    with pytest.raises(UserError, match=r"no benchmarks in .*; in a checkout: pip install"):
        suite.cases("")


def test_benchmarks_that_cannot_be_listed_are_one_line(monkeypatch, tmp_path):
    (tmp_path / "tests" / "benchmarks").mkdir(parents=True)
    (tmp_path / "tests" / "benchmarks" / "cases.py").touch()
    (tmp_path / "tests" / "benchmarks" / "worker.py").write_text("raise ImportError('no such thing')\n")
    monkeypatch.setattr(suite, "CHECKOUT", tmp_path)
    with pytest.raises(UserError, match="cannot be listed: ImportError: no such thing"):
        suite.cases("")


def test_a_worker_goes_on_after_what_it_cannot_do(worker):
    with pytest.raises(LookupError, match="KeyError: 'no such case'"):
        worker.ask("no such case", 1)
    assert worker.ask(CASE, 2)["seconds"] > 0
    assert worker.ask(CASE, "facts")["facts"]["padded"]
    assert not worker.ended


def test_a_module_that_is_not_installed_is_named(tmp_path):
    (tmp_path / "worker.py").write_text('input(); print(\'{"error": "...", "missing": "jax"}\')\n')
    with suite.Worker(cache=tmp_path, benchmarks=tmp_path) as process, pytest.raises(suite.MissingError, match="jax"):
        process.ask(CASE, 1)


def test_a_process_that_ends_says_so(tmp_path):
    (tmp_path / "worker.py").write_text("raise SystemExit\n")
    with suite.Worker(cache=tmp_path, benchmarks=tmp_path) as process:
        process.process.wait()
        with pytest.raises(LookupError, match="the process ended"):
            process.ask(CASE, 1)
        assert process.ended


def test_a_steady_heap_takes_no_new_pages(tmp_path):
    """A call makes four arrays of 51 MB, of 12,000 pages each."""
    bare = "gradient step, 1080x1920, 100 mm | four bare transforms"
    with suite.Worker("--steady", "1", cache=tmp_path, heap=suite.STEADY) as process:
        faults = [process.ask(bare, 2)["faults"] for _ in range(3)]
        held = process.ask(bare, "memory")["bytes"]
    assert min(faults) < 500
    assert held is None or 2e8 < held < 1e9


def test_all_versions_take_part_in_every_turn_in_changing_order():
    asked = []
    versions = {name: lambda name=name: asked.append(name) or {"seconds": len(asked)} for name in "abc"}
    turns = suite.in_turns(versions, Random(1), 0.0, 5, 9)
    assert len(turns) == 5
    assert all(set(turn) == set("abc") for turn in turns)
    assert len({tuple(asked[start : start + 3]) for start in range(0, 15, 3)}) > 1
    assert len(suite.in_turns(versions, Random(1), 60.0, 5, 9)) == 9
