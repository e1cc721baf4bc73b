"""What a method's process says of itself, right or wrong, is taken or refused in one line."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.core.device import CPU
from holobench_eval.core.errors import CellError, UserError
from holobench_eval.study import isolation
from holobench_eval.study.definition import Limits
from holobench_eval.study.isolation.messages import Channel
from holobench_eval.study.versions import method_version
from tests.support import plugins

METHOD = plugins.text("plain")
NUL, ESCAPE, HALF = "\0", "\x1b[31m", "\ud800"  # no text for a system, for a terminal, for a file
FACTS: dict[str, list[Any]] = {
    "name": [NUL, "", 3, "x" * 10**6, HALF, ESCAPE],
    "doc": [ESCAPE, None, HALF],
    "flags": [[], {"camera": "yes"}, {"version": "x"}, {"version": -1}, {"tuned": 3}, {"tuned": ESCAPE}, {"form": 3}],
    "functions": [["__init__"], [], ["available"], None],
    "refused": [3, ESCAPE],
    "code": [None, {}],
    "seconds": [math.nan, -1.0, math.inf, "x"],
    "enclosed": [None, 3],
}
CODE: dict[str, list[Any]] = {
    "name": [NUL],
    "files": [{NUL: "0"}, {"../../../etc/passwd": "0"}, {}, {"mine.py": 3}],
    "folder": [NUL, "/nowhere"],
    "bases": [[3], [ESCAPE]],
    "uncovered": [[NUL]],
}
RESULTS: dict[str, list[Any]] = {
    "params": [3, None, {"level": math.nan}, {1: 2}, {"level": {}}, {HALF: 1}],
    "words": [3, None, [], {}],
    "available": [3, [], ESCAPE],
    "files": [3, [3], ["\0"], "abc", [HALF]],
    "external": [3, [], {"a": 3}, {3: "a"}, {"a": "\0"}],
}
NUMBERS = ["x", 10**30, None, [1], math.nan]
RECEIVE, SEND = Channel.receive, Channel.send


def use(folder: Path) -> None:
    """All that a study asks of a method."""
    method: Any = isolation.build("mine.py:Mine", {}, folder)
    isolation.words("mine.py:Mine", folder)
    method.available()
    isolation.digests(method, "target")
    method_version(type(method))
    isolation.measured(["mine.py:Mine"], folder)
    solver = isolation.solver("mine.py:Mine", {}, folder, "files", Limits(seconds=20))
    with isolation.opened(solver, CPU) as ready:
        solver.solve(None, None)
        assert ready.reads


@pytest.fixture
def lie(tmp_path, monkeypatch):
    """Use a method whose process tells something else, as a function makes it of what it really tells."""
    (tmp_path / "mine.py").write_text(METHOD)

    def used(change: Callable[[Any], Any]) -> None:
        monkeypatch.setattr(Channel, "receive", lambda channel: change(RECEIVE(channel)))
        use(tmp_path)

    return used


def test_the_truth_is_taken(lie):
    asked = list[Any]()
    lie(lambda told: asked.append(told) or told)
    assert any(isinstance(told, dict) and told.get("name") == "Mine" for told in asked)


def each(values: dict[str, list[Any]]) -> list[tuple[str, Any]]:
    return [(name, value) for name, several in values.items() for value in several]


@pytest.mark.parametrize(
    ("part", "name", "value"), [*(("", *one) for one in each(FACTS)), *(("code", *one) for one in each(CODE))]
)
def test_facts_that_cannot_be_and_code_that_is_not_that_of_the_file(part, name, value, lie):
    def change(told: Any) -> Any:
        if not (isinstance(told, dict) and "flags" in told):
            return told
        return {**told, part: {**told[part], name: value}} if part else {**told, name: value}

    with pytest.raises(UserError, match=r"method 'mine.py:Mine'"):
        lie(change)


@pytest.mark.parametrize(("name", "value"), each(RESULTS))
def test_results_that_no_function_has(name, value, lie, monkeypatch):
    asked = [""]

    def send(channel: Channel, told: Any) -> None:
        asked[0] = told["function"] if isinstance(told, dict) and "function" in told else asked[0]
        SEND(channel, told)

    monkeypatch.setattr(Channel, "send", send)
    with pytest.raises((UserError, CellError)) as raised:
        lie(lambda told: {**told, "result": value} if isinstance(told, dict) and asked[0] == name else told)
    assert str(raised.value).isprintable() or HALF in str(raised.value)


@pytest.mark.parametrize("value", NUMBERS)
def test_numbers_that_no_process_has(value, lie):
    with pytest.raises((UserError, CellError), match="method"):
        lie(lambda told: value if type(told) is int else told)
