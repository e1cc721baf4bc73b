"""Whatever a method's number comes from, an edit gives it another name, or is told (``tests.support.edits``)."""

import importlib
import sys
from collections.abc import Iterator
from typing import Any

import pytest

from holobench_eval.core import plugins, reads, released
from holobench_eval.core.device import CPU
from holobench_eval.study import isolation
from holobench_eval.study.versions import method_version
from tests.support.edits import AFTER, BEFORE, FORMS, LAYOUTS, Place


@pytest.fixture(autouse=True)
def _forgotten_afterwards(monkeypatch) -> Iterator[None]:
    """What a package of a test has registered and read is not for the next; its paths are taken back before."""
    yield
    monkeypatch.undo()
    forget()


def forget() -> None:
    importlib.invalidate_caches()
    for known in (plugins._entries, plugins._kept_adapter, released.file_of):
        known.cache_clear()  # type: ignore[attr-defined]
    vars(reads.IMPORTED).update(vars(reads.Seen()))


def built(place: Place, name: str) -> Any:
    if place.layout != "installed":
        return plugins.build("methods", place.method(name), {}, place.config.parent)
    for module, loaded in list(sys.modules.items()):
        if str(place.root) in str(vars(loaded).get("__spec__")):
            del sys.modules[module]  # as in a process that begins
    forget()
    return plugins.build("methods", place.method(name), {})


def solved(place: Place, name: str) -> tuple[float, str, isolation.Reads]:
    method = built(place, name)
    with isolation.opened(method, CPU) as ready:
        return method.solve(None, None), method_version(type(method)), ready.reads


def fault(place: Place, name: str) -> str:
    folder = place.config.parent
    value, version, found = solved(place, name)
    again, same, _ = solved(place, name)
    if (value, version) != (again, same) or isolation.changed(found.covered, folder):
        return "is another one without an edit"
    place.edit(name)
    after, edited, _ = solved(place, name)
    if (value, after) != (BEFORE, AFTER):
        return f"gives {value}, {after}"
    is_known, is_told = edited != version or bool(isolation.changed(found.covered, folder)), bool(found.uncovered)
    if is_told != FORMS[name].told and place.layout != "installed":  # whose import may have read what it does not name
        return "is told wrongly"
    return "" if is_known or is_told else "keeps an old number"


@pytest.mark.parametrize("layout", LAYOUTS)
def test_no_edit_keeps_an_old_number(tmp_path, monkeypatch, layout):
    place = Place(tmp_path, layout)
    names = [name for name in FORMS if "numba" not in name and "environment" not in name]
    place.write(names)
    for folder in filter(None, place.environment["PYTHONPATH"].split(":")):
        monkeypatch.syspath_prepend(folder)
    before = list(sys.path)
    wrong = {}
    for name in names:
        try:
            wrong[name] = fault(place, name)
        except Exception as error:
            wrong[name] = repr(error)[:300]
    sys.path[:] = before
    assert {name: why for name, why in wrong.items() if why} == {}
