"""What comparisons, ablations, budgets and predictions answer where no committed report shows it."""

import numpy as np
import pytest

from holobench_eval.report import Results
from holobench_eval.report.board import GROUPS, board
from holobench_eval.report.facts import CALIBRATED, OPEN_LOOP
from holobench_eval.report.stories import answer, comparison, prediction, story_of
from holobench_eval.report.story import subjects
from tests.support.synthetic_study import EIGHT, NOISE, results_of

COMPARED = {"old": 17.0, "new": 19.0, "other": 20.0, "oracle": 25.0, "floor_constant": 15.0}


def table(results: Results) -> str:
    return str(comparison.table(board(results)))


def test_a_display_without_a_difference_has_two_that_lead() -> None:
    means = {"old@a": 17.0, "new@a": 19.0, "old@b": 17.0, "new@b": 17.0}
    first, second = answer(results_of(means, noise=lambda label: NOISE if label == "old" else -NOISE))
    assert first == "a: Best: new, 18.95 dB, +1.90 dB [+1.49, +2.31] against old."
    assert second == "b: Best: old and new, alike, 17.05 dB."


def test_a_network_that_was_trained_without_photographs_stands_among_those_without_a_camera() -> None:
    networks = frozenset({"net", "trained"})
    means = {"old": 17.0, "net": 18.0, "trained": 16.0}
    results = results_of(means, None, {"trained": 5}, trained=networks, blind=frozenset({"net"}))
    assert answer(results) == ["Best: net, 18.05 dB, +1.00 dB [+1.00, +1.00] against old."]
    groups = {row.label: group for display in board(results).displays for group, rows in display.groups for row in rows}
    assert groups == {"net": GROUPS[OPEN_LOOP], "old": GROUPS[OPEN_LOOP], "trained": GROUPS[CALIBRATED]}


@pytest.mark.parametrize(
    ("better", "among"), [("camera", "photographs of the picture itself"), ("privileged", "knowing the display")]
)
def test_who_leads_below_a_baseline_of_another_group_leads_among_the_others(better: str, among: str) -> None:
    (verdict,) = answer(results_of({"old": 20.0, "plain": 16.0}, **{better: frozenset({"old"})}))
    assert verdict.startswith(f"Best without {among}: plain, 16.05 dB, -4.00 dB")


def test_each_display_is_held_against_its_own_floor() -> None:
    means = {"old@a": 17.0, "new@a": 19.0, "old@b": 17.0, "new@b": 19.0, "floor_constant": 16.0}
    text = table(results_of(means | {"floor_constant@b": 18.0}))
    assert "A gray picture scores 16.05 dB on a; 18.05 dB on b." in text
    assert text.count("no better than gray") == 1


def test_a_method_that_lacks_a_target_has_no_letter_and_is_named_with_its_remedy() -> None:
    full = results_of({"old": 17.0, "new": 19.0, "other": 18.0}, question="Is new better?")
    kept = full.frame[(full.frame["label"] != "new") | (full.frame["target"] != EIGHT[0])].reset_index(drop=True)
    holed = Results(kept, full.facts)
    first, second = answer(holed)
    assert first == "Best: other, 18.05 dB, +1.00 dB [+1.00, +1.00] against old."
    assert "new lacks 1 of 8 targets (t0)" in second
    assert "name the other 7 targets with --targets to rank all by these" in second
    assert "|  | new, 7 of 8 targets | 19.06 | – |" in table(holed)


def test_two_targets_are_not_tested_and_have_no_letters() -> None:
    few = results_of(COMPARED, targets=EIGHT[:2])
    few = Results(few.frame[few.frame["target"].isin(EIGHT[:2])].reset_index(drop=True), few.facts)
    assert answer(few) == ["Best: other, 20.15 dB, +3.00 dB against old, untested."]
    assert "|  | other | 20.15 | +3.00 (no test) |" in table(few)


def test_a_name_that_begins_another_is_not_taken_for_it() -> None:
    means = {"old": 17.0, "old, tuned": 18.0, "new": 19.0, "new_plus": 20.0}
    assert subjects(results_of(means, question="Is new_plus, or old, tuned, better?")) == ["new_plus", "old, tuned"]


def test_a_baseline_of_another_display_leaves_no_budget_to_answer() -> None:
    captures = {"few": 10, "many": 90}
    results = results_of({"few@a": 17.0, "many@a": 19.0, "old@b": 17.0}, {"few": "online", "many": "online"}, captures)
    assert story_of(results) is comparison
    assert answer(results)


def test_an_ablation_of_a_method_with_another_file_compares_two_methods() -> None:
    means = dict.fromkeys(("old", "first", "second", "third"), 19.0)
    params = {label: {"file": f"{label}.pt"} for label in means}
    results = results_of(means, dict.fromkeys(means, "hil"), params=params)
    assert story_of(results) is comparison


def test_a_prediction_that_lacks_a_target_is_not_ranked() -> None:
    means = {"old": 20.0, "new": 22.0}
    results = results_of(means, measure="prediction", holograms="wirtinger", trained=frozenset(means))
    lost = results.frame["label"].eq("new") & results.frame["target"].eq(EIGHT[0])
    results.frame.loc[lost, ["state", "psnr_linear"]] = "failed", np.nan
    assert story_of(results) is prediction
    assert answer(results) == ["Best: old, 20.05 dB."]
