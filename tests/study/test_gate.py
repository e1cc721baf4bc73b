"""What was edited after a study was planned does not run under the names of the plan."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from holobench_eval.study.artifacts import Artifacts
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from tests.study.studies import compute
from tests.support.trained_study import needs, write

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
def test_code_that_was_edited_is_not_trained(tmp_path: Path, isolation: str) -> None:
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
def test_code_that_was_edited_does_nothing(tmp_path: Path, changes: tuple[tuple[str, str], ...]) -> None:
    (why,) = reasons(write(tmp_path, *changes), edited)
    assert "the code of other.py:Even has changed since the study was planned" in why


@pytest.mark.parametrize("name", ["Even", "Gain"])
def test_the_code_of_images_that_was_edited_is_refused(tmp_path: Path, name: str) -> None:
    (why,) = reasons(
        write(tmp_path, (METHODS, f'methods: ["other.py:{name}"]')), lambda text: f"{text}\n", "trained.py"
    )
    assert "the code of dataset 'trained.py:" in why


@pytest.mark.parametrize(("file", "outdated"), [("other.py", "other code"), ("trained.py", "other code of its images")])
def test_a_training_of_before_an_edit_is_not_used_after_it(tmp_path: Path, file: str, outdated: str) -> None:
    config, artifacts, path = write(tmp_path, OTHER), Artifacts(tmp_path / "artifacts"), tmp_path / file
    (tmp_path / "other.py").write_text((tmp_path / "trained.py").read_text())
    (before,) = needs(config)
    artifacts.write(before, {}, {"captures": 0, "seconds": 0.0})
    path.write_text(edited(path.read_text()))
    (after,) = needs(config)
    assert before.id != after.id
    assert not artifacts.has(after)
    assert f"was learned with {outdated}" in artifacts.outdated(after)
