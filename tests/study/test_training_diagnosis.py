"""What a method says of its display is kept beside the truth when its training ends."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.display import load_profile
from holobench_eval.display.simulated.ground_truth import truth
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.study import training
from holobench_eval.study.artifacts import PROVENANCE
from tests.support import fake_study
from tests.support.trained_study import artifact_of, compute, write

pytestmark = pytest.mark.usefixtures("no_physics")

TELLING = """

@dataclass(frozen=True)
class Telling(Gain):
    form: ClassVar[frozenset[str]] = FORM

    def estimates(self, learned, spec):
        return [estimate("phase_gain", colour, float(learned["gain"][colour])) for colour in range(3)]
"""


@pytest.fixture
def known(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fake display has a truth: that of the ideal one."""
    profile = load_profile("ideal").scaled((64, 64))
    monkeypatch.setattr(fake_study.FakeBench, "profile", profile, raising=False)
    monkeypatch.setattr(training, "truth", lambda _: truth(SimulatedBench(profile)))


def provenance(folder: Path, form: str) -> dict[str, Any]:
    """Of the training of a method that tells something."""
    config = write(folder, ("trained.py:Gain", "trained.py:Telling"))
    plugins = folder / "trained.py"
    imports = f"from holobench_eval.display.estimates import estimate\n\nFORM = frozenset({form})\n"
    plugins.write_text(plugins.read_text().replace("LOG = ", f"{imports}LOG = ", 1) + TELLING)
    assert compute(config).failed == 0
    return dict(json.loads((artifact_of(config) / PROVENANCE).read_text()))


@pytest.mark.usefixtures("known")
@pytest.mark.parametrize(("form", "missing"), [("[]", ["phase in steps of 2 pi / 256"]), ("['quantisation']", [])])
def test_estimates_are_kept_beside_the_truth_and_what_the_form_has_not(
    tmp_path: Path, form: str, missing: list[str]
) -> None:
    kept = provenance(tmp_path, form)
    rows = kept["estimates"]
    assert [(row["name"], row["colour"]) for row in rows] == [("phase_gain", colour) for colour in range(3)]
    assert [row["truth"] for row in rows] == pytest.approx([1, 1, 1], abs=1e-5)
    assert all(isinstance(row["value"], float) and row["value"] != row["truth"] for row in rows)
    assert kept["missing"] == missing
