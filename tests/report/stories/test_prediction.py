"""Which network predicts best, from made-up scores whose answer is known."""

from collections.abc import Callable

import numpy as np
import pytest

from holobench_eval.report import Results
from holobench_eval.report.stories import answer, prediction, story_of
from tests.support.synthetic_study import EIGHT, NOISE, results_of

PUBLISHED = {"new": {"psnr": 25.0}, "old": {"psnr": 20.0}}


def study(
    means: dict[str, float], noise: Callable[[str], np.ndarray] = lambda label: NOISE, clusters: int = len(EIGHT)
) -> Results:
    results = results_of(means, noise=noise, measure="prediction", reported=PUBLISHED)
    groups = {target: str(index % clusters) for index, target in enumerate(EIGHT)}
    results.frame["cluster"] = results.frame["target"].map(groups)
    assert story_of(results) is prediction
    return results


def scattered(label: str) -> np.ndarray:
    """Means that differ by 0.02 dB do so by chance."""
    return NOISE * (-1 if label == "new" else 1)


@pytest.mark.parametrize(
    ("new", "begin"), [(22.0, "Yes. new, published as best of 2, is number 1 here."), (18.0, "No. ")]
)
def test_the_published_order_holds_or_fails_where_a_test_shows_it(new: float, begin: str) -> None:
    (text,) = answer(study({"old": 20.0, "new": new}))
    assert text.startswith(begin)
    assert f"Best: {'new' if new > 20 else 'old'}, " in text


@pytest.mark.parametrize(("clusters", "told"), [(8, "which no test shows"), (2, "untested"), (4, "untested")])
def test_means_that_no_test_tells_apart_are_no_yes(clusters: int, told: str) -> None:
    text = " ".join(answer(study({"old": 20.0, "new": 20.02 + 0.2}, scattered, clusters)))
    assert f"new, published as best of 2, is number 1 here, {told}." in text
    assert not {"Yes.", "No.", "Best:"} & {*text.split()}
    assert "Highest" in text


def test_networks_that_lead_on_as_many_displays_are_all_named() -> None:
    means = {f"{label}@d{index}": 20.0 for label in ("old", "new") for index in range(8)}
    means |= {f"new@d{index}": 22.0 for index in range(4)}
    text = answer(study(means))[0]
    each = [f"{label} ({mean} dB in the mean over 8)" for label, mean in (("new", 21.05), ("old", 20.05))]
    assert text == f"By PSNR, {each[0]} and {each[1]} lead on 4 of 8 displays each."
