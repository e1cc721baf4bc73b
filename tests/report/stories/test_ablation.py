"""Which change matters, from made-up scores whose answer is known."""

from holobench_eval.report import Results
from holobench_eval.report.stories import ablation, answer, story_of
from tests.support.synthetic_study import EIGHT, NOISE, results_of

MEANS = {"old": 20.0, "less": 18.0, "more": 22.0, "little": 20.05, "none": 20.0}


def study(clusters: int = len(EIGHT)) -> Results:
    """A change that lowers the score, one that raises it, one that does too little to matter, and one that scatters."""
    results = results_of(MEANS, dict.fromkeys(MEANS, "hil"), noise=lambda label: NOISE * (-1 if label == "none" else 1))
    groups = {target: str(index % clusters) for index, target in enumerate(EIGHT)}
    results.frame["cluster"] = results.frame["target"].map(groups)
    assert story_of(results) is ablation
    return results


def test_a_shown_difference_that_is_small_is_counted_as_small_and_not_as_unshown() -> None:
    changes, rest = answer(study())
    assert changes == "Worse: less, -2.00 dB. Better: more, +2.00 dB."
    assert rest == "2 of 4 change it by less than 0.1 dB or are not shown to change it."


def test_changes_on_two_clusters_are_untested_and_counted_nowhere() -> None:
    assert answer(study(clusters=2)) == ["Untested: less, -2.00 dB; more, +2.00 dB; 2 more."]
