"""Run tests against mutants, a forked process each, in which torch and all that is not the package is there already.

A mutant in the body of a function takes the function's place in a fork of a process that has collected the tests; any
other, and one whose function runs while the package is imported, needs a process that imports the package anew. Tests
that reach the statement come first, then those that reach its file; what is executed on import is put to all tests. Of
each the quickest come first.

cosmic-ray starts an interpreter for each mutant, which takes ten seconds here; mutmut leaves out constants of modules
and functions with decorators, as those of autograd and of caches have.
"""

from __future__ import annotations

import functools
import gc
import importlib
import json
import os
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib.machinery import SourceFileLoader
from itertools import accumulate
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import coverage
import pytest
from _pytest.main import pytest_runtestloop
from hypothesis import Phase, settings

from .mutate import Mutant

ROOT = Path(__file__).parents[2]
OPTIONS = ["-n0", "-x", "-q", "-pno:cacheprovider", "-pno:faulthandler", "--capture=no", "--no-header", "--no-summary"]
MEMORY = 6 * 2**30
COLLECTING = 90.0  # seconds of a processor
ONCE = 10.0  # seconds of a processor, for what the first test has to load
PATIENCE = 1200.0  # seconds, for a mutant that only waits
ELSEWHERE = (
    "cv2", "flip_evaluator", "kornia", "matplotlib.pyplot", "numba", "pandas", "pydantic", "rich.console",
    "scipy.ndimage", "scipy.special", "scipy.stats", "skimage.data", "skimage.metrics", "skimage.transform", "torch",
    "torchmetrics.functional.image", "typer", "yaml",
)  # fmt: skip

Seconds = dict[str, float]
"""By a test's name."""
Name = tuple[str, tuple[str, int] | None]
"""Of a function: its file, and its qualified name and first line."""


def preload() -> None:
    """Import what the package and its tests import from elsewhere, so that a fork has it."""
    for name in ELSEWHERE:
        importlib.import_module(name)


def apart(work: Callable[[], int]) -> str:
    """``survived`` where work gives 0 in a fork, ``timed out`` where a timer ends it, else ``killed``."""
    process = os.fork()
    if process == 0:
        status = 1
        try:
            os.setsid()
            nothing = os.open(os.devnull, os.O_RDWR)
            for stream in (0, 1, 2):
                os.dup2(nothing, stream)
            resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
            signal.setitimer(signal.ITIMER_PROF, COLLECTING)
            status = work()
        finally:
            os._exit(status)
    until, ended, status = time.monotonic() + PATIENCE, 0, signal.SIGPROF
    while not ended and time.monotonic() < until:
        ended, status = os.waitpid(process, os.WNOHANG)
        time.sleep(0.003)
    with suppress(ProcessLookupError):
        os.killpg(process, signal.SIGKILL)  # also what it left running
    if not ended:
        os.waitpid(process, 0)
        return "timed out"
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGPROF:
        return "timed out"
    return "killed" if status else "survived"


def warm(folders: list[str], mutants: list[tuple[Path, Mutant]], most: float) -> list[tuple[str, Seconds]]:
    """Verdict and tests of each mutant of some files; the verdict ``cold`` is still to be found, see there."""
    with tempfile.TemporaryDirectory() as scratch:
        answer = Path(scratch) / "answer.json"
        process = os.fork()
        if process == 0:
            try:
                pytest.main([*OPTIONS, *folders], plugins=[_Campaign(mutants, most, answer)])
            finally:
                sys.stdout.flush()
                os._exit(0)
        os.waitpid(process, 0)
        if not answer.exists():
            sys.exit(f"the tests fail without a mutant: pytest -n 0 {' '.join(folders)}")
        found: list[tuple[str, Seconds]] = json.loads(answer.read_text())
        return found


def cold(file: Path, code: CodeType, tests: Seconds) -> int:
    """The exit status of tests where the package is not imported yet, with the code of a mutant in a file's place."""
    original = SourceFileLoader.get_code

    def get_code(self: SourceFileLoader, fullname: str) -> CodeType | None:
        return code if self.path == str(file) else original(self, fullname)

    SourceFileLoader.get_code = get_code  # type: ignore[assignment, method-assign]
    return pytest.main([*OPTIONS, *tests], plugins=[_Timed(tests)])


class _Campaign:
    """A plug-in of pytest that puts mutants to the tests in place of running these once."""

    def __init__(self, mutants: list[tuple[Path, Mutant]], most: float, answer: Path) -> None:
        self.mutants, self.most, self.answer = mutants, most, answer
        self.files = sorted({str(file) for file, _ in mutants})
        self.imported = coverage.Coverage(data_file=None, config_file=False, include=self.files)
        self.imported.start()

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        _do_not_shrink(items)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        self.imported.stop()
        early = {file: set(self.imported.get_data().lines(file) or ()) for file in self.files}
        reach, seconds = self.unmutated(session)
        functions = _functions(self.files)
        gc.freeze()
        found = []
        for file, mutant in self.mutants:
            place, lines = functions.get((str(file), mutant.function), []), reach[str(file)]
            imported = not place or bool(early[str(file)].intersection(mutant.lines))
            near = {test for line in mutant.lines for test in lines.get(line, ())}
            # A shared fixture or a cache is filled in one test, and others that depend on it do not reach the line.
            reaching = {test for tests in lines.values() for test in tests}
            near_first = {test: (not imported and test not in near, seconds[test]) for test in seconds}
            tests = sorted(seconds if imported else reaching, key=near_first.__getitem__)
            taken = accumulate(seconds[test] for test in tests)
            kept = {test: seconds[test] for test, sum_ in zip(tests, taken, strict=True) if sum_ <= self.most}
            code = None if imported else _code_of(mutant.code, mutant.function)
            verdict = "survived" if not kept else "cold"
            if kept and code is not None and all(code.co_freevars == each.__code__.co_freevars for each in place):
                verdict = apart(functools.partial(_in_place, session, kept, place, code))
            if verdict != "cold":
                print(f"{verdict:9} {file.stem} {mutant.name}", flush=True)
            found.append((verdict, kept))
        self.answer.write_text(json.dumps(found))
        return True

    def unmutated(self, session: pytest.Session) -> tuple[dict[str, dict[int, list[str]]], Seconds]:
        """Which tests reach which lines of which file, and how long each takes."""
        answer, traced = self.answer.with_suffix(".unmutated"), _Traced(self.files)

        def work() -> int:
            signal.setitimer(signal.ITIMER_PROF, 0)
            session.config.pluginmanager.register(traced)
            traced.coverage.start()
            pytest_runtestloop(session)
            traced.coverage.stop()
            lines = [list(traced.coverage.get_data().contexts_by_lineno(file).items()) for file in self.files]
            answer.write_text(json.dumps([lines, traced.seconds]))
            return int(session.testsfailed > 0)

        if apart(work) != "survived":
            sys.exit(1)
        lines, seconds = json.loads(answer.read_text())
        reached = ({line: [test for test in tests if test] for line, tests in some} for some in lines)
        return dict(zip(self.files, reached, strict=True)), seconds


class _Traced:
    """A plug-in that notes the lines and the seconds of each test."""

    def __init__(self, files: list[str]) -> None:
        self.seconds: Seconds = {}
        self.coverage = coverage.Coverage(data_file=None, config_file=False, include=files)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self.coverage.switch_context(item.nodeid)
        began = time.process_time()
        result = yield
        self.seconds[item.nodeid] = time.process_time() - began
        return result


class _Timed:
    """A plug-in that ends the process where a test takes a few times what it takes without a mutant."""

    def __init__(self, seconds: Seconds) -> None:
        self.seconds = seconds

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        _do_not_shrink(items)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> None:
        signal.setitimer(signal.ITIMER_PROF, ONCE + 4 * self.seconds[item.nodeid])


def _in_place(session: pytest.Session, tests: Seconds, place: list[FunctionType], code: CodeType) -> int:
    for function in place:
        function.__code__ = code
    session.config.pluginmanager.register(_Timed(tests))
    items = {item.nodeid: item for item in session.items}
    session.items = [items[test] for test in tests]
    pytest_runtestloop(session)
    return int(session.testsfailed > 0)


def _do_not_shrink(items: list[pytest.Item]) -> None:
    """Any failing example of Hypothesis does: a smaller one is not looked for."""
    for item in items:
        test: Any = getattr(item, "obj", None)
        if own := getattr(test, "_hypothesis_internal_use_settings", None):
            test._hypothesis_internal_use_settings = settings(own, phases=(Phase.explicit, Phase.generate))


def _functions(files: list[str]) -> dict[Name, list[FunctionType]]:
    """The functions of some files; what the package keeps in caches is dropped."""
    found: dict[Name, list[FunctionType]] = {}
    for each in gc.get_objects():
        if type(each) is functools._lru_cache_wrapper and str(each.__module__).startswith("holobench_eval"):
            each.cache_clear()
        elif type(each) is FunctionType and each.__code__.co_filename in files:
            code = each.__code__
            found.setdefault((code.co_filename, (code.co_qualname, code.co_firstlineno)), []).append(each)
    return found


def _code_of(code: CodeType, function: tuple[str, int] | None) -> CodeType | None:
    if (code.co_qualname, code.co_firstlineno) == function:
        return code
    inner = (_code_of(each, function) for each in code.co_consts if isinstance(each, CodeType))
    return next((each for each in inner if each is not None), None)
