"""A method or a dataset of this package that is not as it was released has another name than the released one."""

from pathlib import Path
from typing import Any

import pytest

from holobench_eval.core import plugins, released
from holobench_eval.report.phrases import edited as told
from holobench_eval.study.versions import dataset_version, method_version
from tests.golden.released import digests


def test_what_ships_is_what_was_released() -> None:
    assert released.digests() == digests(), (
        "run `python -m tests.golden.released`, and raise the versions that CONTRIBUTING.md names"
    )


@pytest.fixture
def edit(monkeypatch):
    """Let a module differ from the released one."""

    def differ(module: str) -> None:
        others = {**released.digests(), f"holobench_eval.{module}": "0"}
        monkeypatch.setattr(released, "digests", lambda: others)

    return differ


@pytest.mark.parametrize(
    ("module", "changed"),
    [
        ("methods.wirtinger", {"wirtinger", "sgd"}),
        ("methods.descent", {"wirtinger", "sgd"}),
        ("methods.double_phase", {"wirtinger", "sgd", "double_phase", "gerchberg_saxton", "phases"}),
        ("optics.transfer", {"wirtinger", "sgd", "double_phase", "gerchberg_saxton", "phases"}),
        ("methods.common", {"wirtinger", "sgd", "double_phase", "gerchberg_saxton", "phases"}),
        ("methods.hio", set()),
        ("datasets.charts", set()),
    ],
)
def test_an_edit_counts_for_the_methods_that_use_what_was_edited(edit, module, changed) -> None:
    methods = {
        name: plugins.find("methods", name)
        for name in ("wirtinger", "sgd", "double_phase", "gerchberg_saxton", "phases")
    }
    before = {name: method_version(cls) for name, cls in methods.items()}
    edit(module)
    assert {name for name, cls in methods.items() if method_version(cls) != before[name]} == changed


def test_an_edited_method_and_an_edited_dataset_are_told(edit) -> None:
    def record() -> dict[str, Any]:
        code = method_version(plugins.find("methods", "wirtinger"))
        return {"label": "mine", "cell": {"code": code, "dataset": "charts"}}

    charts = plugins.find("datasets", "charts")
    assert (told([record()]), dataset_version("charts", charts)) == ("", "")
    edit("methods.wirtinger")
    assert told([record()]).startswith("Edited: the code of mine is not as released")
    edit("datasets.charts")
    assert told([record()]).startswith("Edited: the code of mine and charts is not")
    assert dataset_version("charts", charts)


def test_a_users_method_that_uses_an_edited_file_has_another_name(edit, tmp_path) -> None:
    (tmp_path / "mine.py").write_text(
        "def Mine(target, bench):\n    from holobench_eval.optics import padding\n    return target\n"
    )
    before = method_version(plugins.find("methods", "mine.py:Mine", tmp_path))
    edit("optics.padding")
    assert method_version(plugins.find("methods", "mine.py:Mine", tmp_path)) != before


def test_comments_and_layout_are_no_code(tmp_path) -> None:
    texts = (
        "def f(x=0):\n    return [x, None]\n",
        '"""Title."""\n\ndef f(x = 0):  # much\n    "words"\n    return [\n        x, None,\n    ]\n',
        "def f(x=None):\n    return [x, None]\n",
        "def f(x=False):\n    return [x, None]\n",
        "def f(x=0):\n    return [x]\n",
    )
    files = [Path(tmp_path, f"{number}.py") for number in range(len(texts))]
    for file, text in zip(files, texts, strict=True):
        file.write_text(text)
    first, same, *others = map(released.code_digest, files)
    assert first == same
    assert len({first, *others}) == 4
