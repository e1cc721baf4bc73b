"""What captures buy, from made-up scores whose answer is known."""

import numpy as np
import pytest

from holobench_eval.report import Results
from holobench_eval.report.stories import answer, budget, story_of
from tests.support.synthetic_study import EIGHT, NOISE, results_of

NAMES = {"new, 10": "new", "new, 20": "new"}
CAPTURES = {"new, 10": 10, "new, 20": 20}


def study(low: float, high: float, clusters: int = len(EIGHT)) -> Results:
    """A baseline at 20 dB, and a method with two numbers of captures, which scatters about it otherwise."""
    means = {"old": 20.0, "new, 10": low, "new, 20": high}
    groups = {target: str(index % clusters) for index, target in enumerate(EIGHT)}
    results = results_of(
        means,
        NAMES,
        CAPTURES,
        noise=lambda label: 3 * (NOISE if label.startswith("old") else NOISE[::-1] + 0.1),
        camera=frozenset(CAPTURES),
    )
    results.frame["cluster"] = results.frame["target"].map(groups)
    assert story_of(results) is budget
    return results


def test_the_fewest_captures_that_beat_the_baseline_are_told_and_who_leads() -> None:
    (text,) = answer(study(20.0, 25.0))
    assert text.startswith("Photographs that it takes to beat old: new 160. Best: new, 20 with 160, 25.")


def test_rows_that_no_test_tells_apart_are_named_beside_the_highest() -> None:
    (text,) = answer(study(25.0, 25.05))
    assert "Highest: new, 20 with 160, 25.50 dB, not told apart from new, 10." in text


@pytest.mark.parametrize("clusters", [2, 4])
def test_too_few_clusters_for_a_test_say_no_and_best_of_nobody(clusters: int) -> None:
    text = " ".join(answer(study(24.0, 25.0, clusters)))
    assert "Too few targets to test against old: new. Highest, untested: new, 20 with 160" in text
    assert "No:" not in text


def test_a_display_on_which_no_method_has_every_target_is_passed_over() -> None:
    levels = {"old": 20.0, "new, 10": 25.0, "new, 20": 26.0}
    means = {f"{label}@{name}": mean for label, mean in levels.items() for name in ("a", "b")}
    results = results_of(means, NAMES, CAPTURES)
    lost = (results.frame["condition"] == "b") & (results.frame["target"] == "t1")
    results.frame.loc[lost, ["state", "psnr_linear"]] = "failed", np.nan
    verdicts = list(budget.verdicts(results))
    assert [text.partition(":")[0] for text in verdicts] == ["a"]
