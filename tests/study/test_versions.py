import importlib
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from holobench_eval.core import plugins
from holobench_eval.core.sources import Code, code_of
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.study.artifacts import Artifacts
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from holobench_eval.study.versions import method_version
from tests.study.studies import compute
from tests.support.studies.trained_study import needs, write


def test_the_code_of_an_installed_method_is_all_of_its_package(tmp_path, monkeypatch):
    files = {"__init__.py", "unused.py", "plug/__init__.py", "plug/method.py", "plug/deep/first.py", "data.txt"}
    for name in files:
        (tmp_path / "a_shop" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "a_shop" / name).write_text("class Method: ...")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def code() -> Code:
        for name in [name for name in sys.modules if name.startswith("a_shop")]:
            del sys.modules[name]
        return code_of(importlib.import_module("a_shop.plug.method").Method)

    before = code()
    assert set(before.files) == files
    assert code().sha256 == before.sha256
    other = code_of(importlib.import_module("a_shop.plug.deep.first").Method)  # of the same package and name
    assert (other.files, other.sha256 == before.sha256) == (before.files, False)
    (tmp_path / "a_shop" / "data.txt").write_text("6.0")
    assert code().sha256 != before.sha256


def test_a_shipped_method_is_named_by_its_declared_version(monkeypatch):
    assert method_version(Wirtinger) == "Wirtinger 1"
    monkeypatch.setattr(Wirtinger, "version", 2, raising=False)
    assert method_version(Wirtinger) == "Wirtinger 2"


MINE = "from holobench_eval.methods.wirtinger import Wirtinger\n\nclass Method(Wirtinger): ...\n"


def version(folder: Path, name: str = "Method") -> str:
    return method_version(plugins.find("methods", f"mine.py:{name}", folder))


CALLING = MINE.replace(
    "class Method(Wirtinger): ...", "def Method(target, bench):\n    return Wirtinger().solve(target, bench)"
)


@pytest.mark.parametrize("text", [MINE, CALLING])
def test_a_users_method_follows_the_version_of_its_base_and_of_what_it_calls(tmp_path, text, monkeypatch):
    (tmp_path / "mine.py").write_text(text)
    before = version(tmp_path)
    monkeypatch.setattr(Wirtinger, "version", 2, raising=False)
    assert version(tmp_path) != before


def test_a_shipped_class_under_the_name_of_a_file_is_that_files(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    assert len(version(tmp_path, "Wirtinger")) == 64
    assert method_version(Wirtinger) == "Wirtinger 1"


pytestmark = pytest.mark.usefixtures("no_physics")

METHODS = 'methods: ["trained.py:Gain"]'
OTHER = (METHODS, METHODS.replace("trained", "other"))  # in a file beside that of the images


def reasons(config: Path, edit: Callable[[str], str], file: str = "other.py") -> set[str]:
    """Why a study's methods fail where a file is edited between plan and run; ``other.py`` is a copy of the first."""
    (config.parent / "other.py").write_text((config.parent / "trained.py").read_text())
    planned, path = plan(load_study(config)), config.parent / file
    path.write_text(edit(path.read_text()))
    records = compute(config, config.parent / "out", grid=planned).records
    return {record["reason"] for record in records if not record["label"].startswith("floor")}


def edited(text: str) -> str:
    return text.replace("6 * torch.rand", "3 * torch.rand") + "# edited\n"


@pytest.mark.parametrize("isolation", ["files", "none"])
def test_code_that_was_edited_is_not_trained(tmp_path, isolation):
    config = write(tmp_path, OTHER, ("seed: 3", f"seed: 3\nisolation: {isolation}"))
    assert reasons(config, edited) == {
        "not trained: the code of other.py:Gain has changed since the study was planned; start the run again"
    }
    assert not list((tmp_path / "artifacts").rglob("learned.pt"))


EVEN, PREDICTING = (METHODS, 'methods: ["other.py:Even"]'), "seed: 3\nmeasure: prediction"
AT_WORK = {
    "solves": (EVEN, ("seed: 3", "isolation: files")),
    "solves inside": (EVEN, ("seed: 3", "isolation: none")),
    "predicts": (EVEN, ("seed: 3", PREDICTING)),
    "gives a hologram": (
        (METHODS, 'methods: ["trained.py:Even"]'),
        ("seed: 3", f"{PREDICTING}\nholograms: {{name: 'other.py:Even'}}"),
    ),
}


@pytest.mark.parametrize("changes", AT_WORK.values(), ids=AT_WORK)
def test_code_that_was_edited_does_nothing(tmp_path, changes):
    (why,) = reasons(write(tmp_path, *changes), edited)
    assert "the code of other.py:Even has changed since the study was planned" in why


@pytest.mark.parametrize("name", ["Even", "Gain"])
def test_the_code_of_images_that_was_edited_is_refused(tmp_path, name):
    (why,) = reasons(
        write(tmp_path, (METHODS, f'methods: ["other.py:{name}"]')), lambda text: f"{text}\n", "trained.py"
    )
    assert "the code of dataset 'trained.py:" in why


@pytest.mark.parametrize(("file", "outdated"), [("other.py", "other code"), ("trained.py", "other code of its images")])
def test_a_training_of_before_an_edit_is_not_used_after_it(tmp_path, file, outdated):
    config, artifacts, path = write(tmp_path, OTHER), Artifacts(tmp_path / "artifacts"), tmp_path / file
    (tmp_path / "other.py").write_text((tmp_path / "trained.py").read_text())
    (before,) = needs(config)
    artifacts.write(before, {}, {"captures": 0, "seconds": 0.0})
    path.write_text(edited(path.read_text()))
    (after,) = needs(config)
    assert before.id != after.id
    assert not artifacts.has(after)
    assert f"was learned with {outdated}" in artifacts.outdated(after)
