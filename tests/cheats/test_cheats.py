"""What comes of methods that cheat: nothing that another method's digits, or their own, would show."""

import math
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.study.isolation import process
from tests.cheats import attempts
from tests.study.studies import compute, write_green

NAMES = [
    name
    for name, value in vars(attempts).items()
    if isinstance(value, type)
    and issubclass(value, attempts.Attempt)
    and not value.__subclasses__()
    and name != "Beside"
]
DIGITS = ("scores", "efficiency", "brightness", "saturated", "registration_residual_px")
PART = process.KEPT - 4  # attempts of a study, else their processes would be started again for every step of it


def scored(folder: Path, names: list[str], calls: int, seconds: float, isolation: str = "files") -> dict[str, Any]:
    """Records by label of a study of these attempts, with methods of the package after them, in one process."""
    listed = ""
    for name in names:
        listed += f"  - {{name: 'attempts.py:{name}'"
        listed += ", captures: 2}\n" if getattr(getattr(attempts, name), "camera", False) else "}\n"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "attempts.py").write_bytes(Path(attempts.__file__).read_bytes())
    write_green(folder, "leto-mild")
    (folder / "study.yaml").write_text(
        f"""title: cheats
display: {{profiles: [green.yaml], panel: [128, 128]}}
targets: {{dataset: photographs, params: {{count: 1}}}}
training: {{dataset: dead_leaves, params: {{count: 2}}, held_out: 1, captures: 3}}
protocol: {{metrics: [psnr]}}
repeats: {calls}
isolation: {isolation}
limits: {{seconds: {seconds}, memory_gib: 3}}
methods:
{listed}  - {{name: 'attempts.py:Beside', label: beside}}
  - double_phase
"""
    )
    found: dict[str, list[Any]] = {}
    for record in compute(folder / "study.yaml", folder / "out").records:
        found.setdefault(record["label"], []).append(record)
    return found


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    """All attempts, together with those that need as many calls and as long a limit."""
    alike: dict[tuple[int, float], list[str]] = {}
    for name in NAMES:
        attempt = getattr(attempts, name)
        alike.setdefault((attempt.calls, 2.0 if "more than" in attempt.reason else 60.0), []).append(name)
    parts = [(names[at : at + PART], *how) for how, names in alike.items() for at in range(0, len(names), PART)]
    return [scored(tmp_path_factory.mktemp("cheats"), *part) for part in parts]


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """A study without a cheat, its honest methods inside."""
    return scored(tmp_path_factory.mktemp("alone"), [], 2, 60.0, isolation="none")


def digits(found: list[Any]) -> list[Any]:
    return [[record.get(name) for name in DIGITS] for record in found]


def test_the_page_on_trust_counts_the_attempts():
    cheats = [getattr(attempts, name) for name in NAMES if name != "Honest"]
    page = " ".join((Path(__file__).parents[2] / "docs/start/trust.md").read_text().split())
    counts = Counter(cheat.outcome for cheat in cheats)
    assert f"{len(cheats)} attempts of methods" in page
    assert f"{counts['impossible']} get the number of the honest phase, {counts['refused']} fail with a reason" in page
    assert f"nothing prevents {counts['trusted']}:" in page


@pytest.mark.parametrize("name", NAMES)
def test_an_attempt_has_its_outcome(name, studies, alone):
    attempt = getattr(attempts, name)
    (found,) = (study[name] for study in studies if name in study)
    assert len(found) == attempt.calls
    for record in found:
        if attempt.outcome == "refused":
            assert record["state"] == "failed", record["scores"]
            assert attempt.reason in record["reason"]
        else:
            assert record["state"] == "done", record["reason"]
            assert record["captures"] in (0, 2) if getattr(attempt, "camera", False) else record["captures"] == 0
            assert record["seconds"] > (0.4 if getattr(attempt, "slow", False) else 0.0)
            assert (record["memory_mib"] or math.inf) > getattr(attempt, "mib", 0)
            assert (record["cpu_s"] or math.inf) > getattr(attempt, "cpu", 0)
    if attempt.outcome == "impossible":
        assert digits(found) == digits(alone["beside"][: len(found)])


@pytest.mark.parametrize("label", ["beside", "double_phase"])
def test_no_attempt_changes_a_digit_of_the_methods_beside_it(label, studies, alone):
    for study in studies:
        assert digits(study[label]) == digits(alone[label][: len(study[label])])
