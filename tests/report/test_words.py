"""What a report says, whatever its kind: short verdicts that tables bear out, and no interval of what is not shown."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from holobench_eval.report.board import board
from holobench_eval.report.phrases import ALIKE, MARGINS, UNSHOWN, effect, too_few
from holobench_eval.report.results import Results
from holobench_eval.report.stories import MOST_WORDS, answer, stories
from tests.support.synthetic_study import EIGHT, NOISE, results_of

REPORTS = sorted(Path(__file__).parents[2].glob("reports/*/details.md"))
CLOSE = {"old": 17.0, "new": 17.4, "other": 18.5}


def noisy(label: str) -> np.ndarray:
    """Pictures on which ``new`` is better and on which it is worse."""
    return NOISE if label == "old" else -5 * NOISE if label == "new" else NOISE[::-1]


def kinds() -> Iterator[Results]:
    """Studies of several kinds with the same scores."""
    yield results_of(CLOSE, question="Is new better than old?", noise=noisy)
    yield results_of(CLOSE, names=dict.fromkeys(CLOSE, "hil"), noise=noisy)
    yield results_of(CLOSE, measure="prediction", holograms="old", trained=frozenset(CLOSE), noise=noisy)
    captures = {"new": 10, "other": 90}
    yield results_of(CLOSE, {"new": "online", "other": "online"}, captures, noise=noisy)


@pytest.mark.parametrize("results", kinds(), ids=["comparison", "ablation", "prediction", "budget"])
def test_verdicts_are_short_and_name_the_first_of_the_board(results: Results) -> None:
    verdicts = answer(results)
    assert all(len(verdict.split()) <= MOST_WORDS for verdict in verdicts)
    first = max(board(results).displays[0].rows, key=lambda row: row.score.mean)
    assert first.label in " ".join(verdicts)


@pytest.mark.parametrize("results", kinds(), ids=["comparison", "ablation", "prediction", "budget"])
def test_what_is_not_shown_has_no_interval(results: Results) -> None:
    for sentence in re.split(r"(?<=[.;]) ", " ".join(answer(results))):
        assert not (UNSHOWN in sentence and "[" in sentence), sentence


def test_a_question_of_yes_and_no_begins_with_one() -> None:
    unshown = results_of({"old": 17.0, "new": 17.4}, question="Is new better than old?", noise=noisy)
    assert answer(unshown)[0].startswith("No. new is not shown to differ from old, +")
    shown = results_of({"old": 17.0, "new": 19.0}, question="Is new better than old?")
    assert answer(shown)[0].startswith("Yes. new beats old, +2.00 dB [")
    worse = results_of({"old": 17.0, "new": 16.0}, question="Is new better than old?")
    assert answer(worse)[0].startswith("No. new loses to old, -1.00 dB [")
    assert not re.match("Yes|No", answer(results_of({"old": 17.0, "new": 19.0}, question="What does new gain?"))[0])


def test_a_difference_below_the_margin_is_no_gain() -> None:
    small = MARGINS["dB"][0] / 2
    results = results_of({"old": 17.0, "new": 17.0 + small}, question="Is new better than old?")
    test = results.tested("new", "bench")
    assert test is not None
    assert test.is_shown
    assert effect(results.headline, test) == ALIKE
    assert answer(results)[0].startswith("No. new is as good as old, +0.05 dB.")


def test_a_study_that_can_show_nothing_says_so_first_and_counts() -> None:
    few = results_of({"old": 17.0, "new": 19.0}, targets=EIGHT[:4], question="Is new better than old?")
    few = Results(few.frame[few.frame["target"].isin(EIGHT[:4])].reset_index(drop=True), few.facts)
    assert answer(few)[0] == too_few(few) != ""
    assert answer(few)[1].startswith("new against old: +2.00 dB, better on 4 of 4 targets.")


def test_limits_are_sentences_under_a_name() -> None:
    known = [text for story in stories() for text in getattr(story, "LIMITS", ())]
    assert known
    assert all(re.match(r"[A-Z][a-z]+: .*\.$", text) and len(text.split()) <= MOST_WORDS for text in known)
