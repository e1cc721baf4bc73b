"""A method whose code or files were edited is another one, however it is written."""

import sys
import tokenize
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holobench_eval.core import plugins
from holobench_eval.core.device import CPU
from holobench_eval.core.errors import CellError, UserError
from holobench_eval.core.sources import code_of
from holobench_eval.study import isolation
from holobench_eval.study.versions import method_version

HEAD = "from dataclasses import dataclass\nfrom typing import ClassVar\nimport functools\n\n"
CLASS = "@dataclass(frozen=True)\nclass Mine:\n"


class Form(NamedTuple):
    """A way to write a method. main: its file; other: a file that it uses; edited: the one that is edited."""

    main: str
    other: tuple[str, str] = ("", "")
    edited: str = "mine.py"


def of_class(body: str, top: str = "", **more: Any) -> Form:
    return Form(f"{HEAD}{top}\n{CLASS}{body}", **more)


SOLVE = "    def solve(self, target, bench):\n        return scaled(target)\n"
SCALED = "def scaled(target):\n    return 1.0 * target\n"


def with_helper(body: str, top: str = "", text: str = SCALED, file: str = "helper.py") -> Form:
    """A class whose number is in another file, which is the one that is edited."""
    return of_class(body, top, other=(file, text), edited=file)


WRAPPED = """import functools

def scaling(function):
    @functools.wraps(function)
    def solve(self, target, bench):
        return 1.0 * function(self, target, bench)
    return solve
"""
DECORATED = "    @scaling\n    def solve(self, target, bench):\n        return target\n"

FORMS = {
    "staticmethod": of_class("    @staticmethod\n    def solve(target, bench):\n        return 1.0 * target\n"),
    "lru_cache": of_class(  # which does not tell its arguments
        "    @functools.lru_cache\n    def solve(self, target, bench):\n        return 1.0 * target\n"
    ),
    "partialmethod": of_class(
        "    def _solve(self, target, bench, odd):\n        return 1.0 * target\n"
        "    solve = functools.partialmethod(_solve, odd=1)\n"
    ),
    "callable object": of_class(
        "    solve = Scaled()\n", "class Scaled:\n    def __call__(self, target, bench):\n        return 1.0 * target\n"
    ),
    "subclass that sets a class variable": of_class(
        "    scale: ClassVar[float] = 0\n    def solve(self, target, bench):\n        return self.scale * target\n"
        "\n@dataclass(frozen=True)\nclass Base(Mine):\n    scale: ClassVar[float] = 1.0 * 1\n\nMine = Base\n"
    ),
    "helper, absolute": with_helper(SOLVE, "from helper import scaled"),
    "helper, relative": with_helper(SOLVE, "from .helper import scaled"),
    "helper inside solve, by a name that is put together": with_helper(
        "    def solve(self, target, bench):\n        import importlib\n"
        "        return importlib.import_module('help' + 'er').scaled(target)\n"
    ),
    "decorator with wraps": with_helper(DECORATED, "from helper import scaling", WRAPPED),
    "weights at import": with_helper(
        "    def solve(self, target, bench):\n        return WEIGHT * target\n",
        "from pathlib import Path\nWEIGHT = eval(Path(__file__).with_name('weights.txt').read_text())\n",
        "1.0 * 1",
        "weights.txt",
    ),
    "weights in solve": with_helper(
        "    def solve(self, target, bench):\n"
        "        return eval(Path(__file__).with_name('weights.txt').read_text()) * target\n",
        "from pathlib import Path",
        "1.0 * 1",
        "weights.txt",
    ),
    "code_version": of_class(
        "    code_version: ClassVar[str] = 'mine'\n    version: ClassVar[int] = 1\n"
        "    def solve(self, target, bench):\n        return 1.0 * target\n"
    ),
    "function with a parameter": Form("def Mine(target, bench, scale: float = 1.0 * 1):\n    return scale * target\n"),
}


def write(folder: Path, form: Form) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in (("mine.py", form.main), form.other):
        if name:
            (folder / name).write_text(text)


def edit(folder: Path, form: Form) -> None:
    file = folder / form.edited
    assert "1.0 *" in file.read_text()
    file.write_text(file.read_text().replace("1.0 *", "0.1 *"))


def solved(method: Any) -> tuple[float, isolation.Reads]:
    with isolation.opened(method, CPU) as ready:
        return method.solve(2.0, None), ready.reads


def inside(folder: Path) -> Any:
    return plugins.build("methods", "mine.py:Mine", {}, folder)


def apart(folder: Path) -> Any:
    return isolation.build("mine.py:Mine", {}, folder)


def assert_an_edit_is_seen(folder: Path, form: Form, build: Callable[[Path], Any]) -> None:
    write(folder, form)
    method = build(folder)
    before, (value, reads) = method_version(type(method)), solved(method)
    assert method_version(type(build(folder))) == before
    assert isolation.changed(reads.covered, folder) == ""
    edit(folder, form)
    again = build(folder)
    assert (value, solved(again)[0]) == (2.0, 0.2)  # the edit matters
    is_read = isolation.changed(reads.covered, folder) == form.edited
    assert method_version(type(again)) != before or is_read


@pytest.mark.parametrize("name", FORMS)
def test_an_edit_makes_another_method_inside(name, tmp_path):
    assert_an_edit_is_seen(tmp_path, FORMS[name], inside)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "subclass that sets a class variable",
        "helper inside solve, by a name that is put together",
        "weights at import",
        "weights in solve",
    ],
)
def test_an_edit_makes_another_method_apart(name, tmp_path):
    assert_an_edit_is_seen(tmp_path, FORMS[name], apart)


IMPORTS = {  # how a file may use the module ``{name}`` in ``{file}``
    "absolute": "import {name}\nvalue += {name}.value",
    "from": "from {name} import value as one\nvalue += one",
    "importlib": "import importlib\nvalue += importlib.import_module('{name}').value",
    "path": "import runpy, pathlib\nvalue += runpy.run_path(str(HOME / '{file}'))['value']",
}
PARTS = {  # where a number may be
    "constant": "value = {number}",
    "lambda": "value = (lambda x={number}: x)()",
    "comment": "value = 1  # {number}",
    "docstring": "value = 1\ndef described():\n    '''{number}'''",
    "class": "class Odd:\n    value = {number}\nvalue = Odd.value",
    "nested": "def outer():\n    def inner():\n        return {number}\n    return inner\nvalue = outer()()",
    "f-string": "value = len(f'{{{number}:d}}')",
}


@settings(max_examples=12)
@given(st.data())
def test_any_token_that_is_edited_makes_another_method(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("random")
    names = data.draw(st.lists(st.sampled_from(["a_", "b_.c_", "d_.e_.f_", "g_", "h_.i_"]), unique=True), "modules")
    files = {f"{name.replace('.', '/')}.py": name for name in names}
    parts = {file: data.draw(st.sampled_from(sorted(PARTS))) for file in ("mine.py", *files)}
    texts = {
        file: f"import pathlib\nHOME = pathlib.Path({str(folder)!r})\n{PARTS[part].format(number=1234)}\n"
        for file, part in parts.items()
    }
    for file, name in files.items():  # each is used by one that comes before it
        earlier = list(texts)[: list(texts).index(file)]
        how = IMPORTS[data.draw(st.sampled_from(sorted(IMPORTS)))]
        texts[data.draw(st.sampled_from(earlier))] += how.format(name=name, file=file) + "\n"
    texts["mine.py"] += "\ndef Mine(target, bench):\n    return value * target\n"
    for file, text in texts.items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text(text)
    before = method_version(type(inside(folder)))
    edited = data.draw(st.sampled_from(sorted(texts)), "edited")
    content = (folder / edited).read_bytes()
    tokens = [token for token in tokenize.tokenize(BytesIO(content).readline) if "1234" in token.string]
    token = data.draw(st.sampled_from(tokens))
    lines = content.decode().splitlines(keepends=True)
    row = token.start[0] - 1 + token.string[: token.string.index("1234")].count("\n")
    lines[row] = lines[row].replace("1234", data.draw(st.sampled_from(["1235", "12_34", "01234"[::-1]])))
    (folder / edited).write_text("".join(lines))
    assert method_version(type(inside(folder))) != before


def test_what_is_refused_says_why(tmp_path):
    write(tmp_path, of_class(SOLVE, "from ..above import scaled"))
    with pytest.raises(UserError, match=r"mine.py:Mine'.*attempted relative import beyond top-level package"):
        inside(tmp_path)


def test_a_module_beside_is_what_the_file_imports_and_no_library(tmp_path, monkeypatch):
    installed, own = tmp_path / "installed", tmp_path / "own"
    for folder in (installed, own):
        folder.mkdir()
        (folder / "beside_.py").write_text(f"NAME = '{folder.name}'")
    (installed / "library_.py").write_text("def late():\n    import beside_\n    return beside_.NAME\n")
    monkeypatch.syspath_prepend(installed)
    for name in ("types", "holobench_eval"):
        (own / f"{name}.py").write_text("raise SystemExit")
    top = "import sys, types, holobench_eval.core, library_\nFIRST = library_.late()\ndel sys.modules['beside_']\n"
    solve = "    def solve(self, target, bench):\n        return FIRST, beside_.NAME\n"
    write(own, of_class(solve, f"{top}import beside_"))
    assert inside(own).solve(0, None) == ("installed", "own")
    monkeypatch.delitem(sys.modules, "library_")


def test_two_folders_with_a_helper_of_one_name_have_each_their_own(tmp_path):
    methods = []
    for number, name in enumerate(("a", "b")):
        write(tmp_path / name, FORMS["helper, absolute"])
        (tmp_path / name / "helper.py").write_text(SCALED.replace("1.0", str(number)))
        methods.append(inside(tmp_path / name))
    assert [method.solve(2.0, None) for method in methods] == [0.0, 2.0]


def test_the_name_in_the_file_counts(tmp_path):
    (tmp_path / "mine.py").write_text("def one(target, bench): ...\n\ndef two(target, bench): ...\n")
    versions = {method_version(plugins.find("methods", f"mine.py:{name}", tmp_path)) for name in ("one", "two")}
    assert len(versions) == 2


def test_a_module_of_the_studys_folder_is_code_of_all_that_import_it(tmp_path, monkeypatch):
    library = tmp_path / "lib" / "library_of_a_study.py"
    library.parent.mkdir()
    library.write_text(SCALED)
    monkeypatch.syspath_prepend(library.parent)

    def versions() -> list[str]:
        names = [f"methods/{name}.py:Mine" for name in ("a", "b", "a")]
        return [method_version(plugins.find("methods", name, tmp_path)) for name in names]

    (tmp_path / "methods").mkdir()
    for name in ("a", "b"):
        text = of_class(SOLVE, "from library_of_a_study import scaled").main
        (tmp_path / "methods" / f"{name}.py").write_text(f"{text}# {name}")
    first, other, again = versions()
    assert first == again != other
    assert method_version(isolation.find("methods/b.py:Mine", tmp_path)) == other
    library.write_text(SCALED.replace("1.0", "0.1"))
    assert {first, other}.isdisjoint(versions())
    assert plugins.build("methods", "methods/b.py:Mine", {}, tmp_path).solve(2.0, None) == 0.2


def test_what_the_import_itself_writes_is_no_code(tmp_path):
    top = "from pathlib import Path\nlog = Path(__file__).with_name('log.txt')\nlog.write_text(log.read_text() + '1')"
    write(tmp_path, of_class("    def solve(self, target, bench):\n        return target\n", top))
    (tmp_path / "log.txt").write_text("")
    first, second = (type(inside(tmp_path)) for _ in range(2))
    assert method_version(first) == method_version(second)
    assert code_of(first).uncovered == (str(tmp_path / "log.txt"),)


def test_a_method_that_was_edited_after_it_was_asked_for_is_not_called(tmp_path):
    form = FORMS["helper, absolute"]
    write(tmp_path, form)
    method = apart(tmp_path)
    edit(tmp_path, form)
    with pytest.raises(CellError, match=r"the code of mine\.py:Mine has changed since the study was planned"):
        solved(method)


@pytest.mark.parametrize("build", [inside, apart])
def test_a_helper_that_is_edited_while_a_call_runs_is_read(tmp_path, build):
    editor = "import subprocess\nEDIT = ['sed', '-i', 's/1.0/0.1/', __file__.replace('mine.py', 'helper.py')]"
    body = (
        "    def solve(self, target, bench):\n        subprocess.run(EDIT)\n"
        "        from helper import scaled\n        return scaled(target)\n"
    )
    write(tmp_path, of_class(body, editor, other=("helper.py", SCALED)))
    value, reads = solved(build(tmp_path))
    assert value == 0.2
    (tmp_path / "helper.py").write_text(SCALED)
    assert isolation.changed(reads.covered, tmp_path) == "helper.py"
