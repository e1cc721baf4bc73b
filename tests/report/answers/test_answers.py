"""What each kind of study answers, from made-up records whose answer is known."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from holobench_eval.report import Results, records_frame
from holobench_eval.report.answers import KINDS, kind_of
from holobench_eval.report.answers.kind import MOST_COLUMNS, MOST_SENTENCES, subjects
from holobench_eval.report.data.layout import Swept
from holobench_eval.study.plan import REFERENCE, is_reference, reference_of
from tests.report.data import test_error_budget as budget_of_errors
from tests.report.sections import test_focus as focus
from tests.report.sections import test_ranks as ranks
from tests.report.sections import test_sweeps as sweeps
from tests.support import synthetic_study as synthetic

TARGETS = tuple(f"t{index}" for index in range(8))
NOISE = np.array([0.0, 0.3, -0.2, 0.1, 0.4, -0.1, 0.2, -0.3])


def results_of(
    means: dict[str, float],
    names: dict[str, str] | None = None,
    captures: dict[str, int] | None = None,
    noise: Callable[[str], np.ndarray] = lambda label: NOISE,
    **changes: Any,
) -> Results:
    """A study of one display, or of the display after ``@`` in a label; names: registered; captures: per target."""
    records, pairs = [], []
    for key, mean in means.items():
        label, _, display = key.partition("@")
        condition = display or "bench"
        if label.startswith("floor_"):
            condition = reference_of(display) if display else REFERENCE
        if not is_reference(condition):
            pairs.append((label, condition))
        for target, value in zip(TARGETS, mean + noise(label), strict=True):
            described = synthetic.cell((names or {}).get(label, label), target, condition, params={"label": label})
            taken = (captures or {}).get(label, 0)
            records.append(synthetic.record(label, described, {"psnr_linear": float(value)}, captures=taken))
    given = {
        "pairs": tuple(pairs),
        "targets": TARGETS,
        "baseline": "old",
        "reported": {},
        "privileged": frozenset({"oracle"}),
    }
    layout = synthetic.layout(**(given | changes))
    return Results(records_frame(records, layout), layout)


def answer(results: Results) -> str:
    return "\n".join(kind_of(results).answer(results))


def name_of(results: Results) -> str:
    return kind_of(results).sentences.__module__.rpartition(".")[2]


COMPARED = {"old": 17.0, "new": 19.0, "other": 20.0, "oracle": 25.0, "floor_constant": 15.0}


def test_each_display_is_held_against_its_own_floor() -> None:
    means = {"old@a": 17.0, "new@a": 19.0, "old@b": 17.0, "new@b": 19.0, "floor_constant": 16.0}
    text = answer(results_of(means | {"floor_constant@b": 18.0}))
    assert "a constant image in the place of a capture (16.05 dB on a and 18.05 dB on b): on b old." in text


def test_the_method_that_the_question_names_is_answered_for_display_by_display() -> None:
    found = results_of(
        {"old@a": 17.0, "new@a": 19.0, "old@b": 17.0, "new@b": 17.0},
        noise=lambda label: NOISE if label == "old" else -NOISE,
        question="Is new better?",
    )
    first, *_ = kind_of(found).answer(found)
    assert first.startswith(
        "new: on a better than old by +1.90 dB [+1.49, +2.31], p = 0.008 (18.95 dB against 17.05 dB)"
    )
    assert re.search(r"; on b -0\.10 dB \[.*\] against old, p = \d\.\d+, not shown \(", first)


def test_a_worse_method_is_not_worse_by_a_minus() -> None:
    found = results_of({"old": 19.0, "new": 17.0}, question="Is new better?")
    assert "worse than old, -2." in answer(found)


def test_without_a_named_method_the_best_one_is_compared_with_the_baseline() -> None:
    text = answer(results_of(COMPARED))
    assert "The best mean PSNR (linear light): on bench other, 20.05 dB, better than old by +3.00 dB" in text
    assert "The oracle, the best phase that was found with the bench known, has 25.05 dB on bench" in text
    assert "so other closes 38" in text


def test_the_table_says_how_large_a_difference_the_tests_of_the_question_could_have_shown() -> None:
    found = results_of(COMPARED, noise=lambda label: NOISE if label == "old" else -NOISE, question="Is new better?")
    size = next(test for test in found.against_baseline if test.second == "new").estimate.detectable
    text = str(kind_of(found).table(found))
    assert f"Alone, a comparison of new could have shown {size:.2f} dB (80 % power, 8 clusters)." in text


def with_ms_ssim(values: dict[str, float]) -> Results:
    found = results_of({"old": 17.0, "new": 19.0})
    frame = found.frame.assign(ms_ssim_linear=found.frame["label"].map(values), brightness_ratio=0.25)
    return Results(frame, found.layout)


def test_ms_ssim_and_brightness_stand_beside_psnr_and_who_is_first_by_ms_ssim_is_named() -> None:
    found = with_ms_ssim({"old": 0.8, "new": 0.7})
    text = str(kind_of(found).table(found))
    assert "| MS-SSIM | brightness ratio |" in text
    assert "| 0.700 | 0.250 |" in text
    assert "By MS-SSIM another method is first: on bench old (0.800 against 0.700 of new)." in text


@pytest.mark.parametrize("values", [{"old": 0.7, "new": 0.8}, {"old": 0.7004, "new": 0.7}, {}])
def test_nothing_is_said_of_ms_ssim_where_it_has_the_same_order_or_none(values: dict[str, float]) -> None:
    found = with_ms_ssim(values) if values else results_of({"old": 17.0, "new": 19.0})
    assert "By MS-SSIM" not in str(kind_of(found).table(found))


def test_who_is_no_better_than_a_constant_image_is_named() -> None:
    text = answer(results_of({"old": 14.0, "new": 19.0, "floor_constant": 15.0}))
    assert (
        "By PSNR no better on average than a constant image in the place of a capture (15.05 dB): on bench old." in text
    )


def test_a_method_that_lacks_a_target_is_not_counted_among_every_method() -> None:
    found = results_of({"old": 17.0, "new": 19.0, "floor_constant": 15.0})
    assert "Every method is better" in answer(found)
    whole = found.frame
    hole = whole[(whole["label"] != "new") | (whole["target"] != TARGETS[0])].reset_index(drop=True)
    text = answer(Results(hole, found.layout))
    assert "Every method with a score for every target is better" in text


def test_a_method_of_the_question_without_a_comparison_is_named() -> None:
    found = results_of({"old": 17.0, "new": 19.0, "other": 18.0}, question="Is new better?")
    hole = found.frame[(found.frame["label"] != "new") | (found.frame["target"] != TARGETS[0])].reset_index(drop=True)
    text = answer(Results(hole, found.layout))
    assert "new lacks 1 of 8 targets (t0)" in text
    assert "name the other 7 targets with --targets to rank all by these" in text


def test_a_baseline_of_another_display_leaves_no_budget_to_answer() -> None:
    captures = {"few": 10, "many": 90}
    found = results_of({"few@a": 17.0, "many@a": 19.0, "old@b": 17.0}, {"few": "online", "many": "online"}, captures)
    assert name_of(found) == "comparison"
    assert answer(found)


def test_a_name_that_begins_another_is_not_taken_for_it() -> None:
    found = results_of(
        {"old": 17.0, "old, tuned": 18.0, "new": 19.0, "new_plus": 20.0}, question="Is new_plus, or old, tuned, better?"
    )
    assert subjects(found) == ["new_plus", "old, tuned"]


def test_two_targets_are_not_tested_and_the_answer_says_so() -> None:
    few = results_of(COMPARED)
    layout = synthetic.layout(
        pairs=few.layout.pairs, targets=TARGETS[:2], baseline="old", reported={}, privileged=few.layout.privileged
    )
    found = Results(few.frame[few.frame["target"].isin(TARGETS[:2])].reset_index(drop=True), layout)
    assert "other, 20.15 dB, not tested against old, +3.00 dB" in answer(found)
    assert "p =" not in answer(found)


def test_an_ablation_says_what_lowers_and_what_is_not_shown_to_matter() -> None:
    means = {"old": 19.0, "no loss": 17.0, "more rounds": 19.0, "no skip": 18.5, "another": 30.0}
    found = results_of(
        means,
        names=dict.fromkeys(("old", "no loss", "more rounds", "no skip"), "hil"),
        noise=lambda label: -NOISE if label == "more rounds" else NOISE,
    )
    assert name_of(found) == "ablation"
    text = answer(found)
    assert "Of 3 single changes of old on bench (19.05 dB), those shown to lower the score: no loss (-2.00 dB" in text
    assert "those shown to raise the score: none." in text
    assert re.search(r"No difference is shown for the other 1, .* from -0\.5\d to \+0\.3\d dB: more rounds\.", text)
    assert "another" not in text.split("No better")[0]


def test_an_ablation_holds_its_changes_against_those_of_another_seed() -> None:
    means = {"old": 19.0, "no loss": 17.0, "no skip": 18.9, "reseeded": 18.5}
    found = results_of(means, names=dict.fromkeys(means, "hil"))
    params = {label: {"seed": int(label == "reseeded"), "skip": label != "no skip"} for label in means}
    text = answer(Results(found.frame, replace(found.layout, params=params)))
    assert "Of 2 single changes of old" in text
    assert re.search(
        r"A second seed .* differs by -0.50 dB \[.*\], so that changes of that size, no skip, may be chance\.", text
    )


def test_a_budget_names_the_fewest_captures_that_pass_and_who_never_does() -> None:
    means = {"old": 17.0, "good, 5": 16.0, "good, 10": 18.0, "good, 20": 19.0, "bad, 5": 15.0, "bad, 10": 16.0}
    found = results_of(
        means,
        names={label: label.split(",")[0] for label in means},
        captures={label: int(label.split(", ")[1]) for label in means if "," in label},
        camera=frozenset(label for label in means if "," in label),
    )
    assert name_of(found) == "budget"
    text = answer(found)
    assert "which takes no captures and has 17.05 dB on bench (fewer may do): good 80 (+1.00 dB" in text
    assert "Not shown to be better than old with any of their budgets: bad (up to 80)." in text
    assert "good +3.00 [+3.00, +3.00], from 40 to 160 captures" in text
    assert "The best row is good, 20 with 160 captures, 19.05 dB." in text


def test_a_budget_is_answered_for_every_display_by_its_name() -> None:
    means = {f"{label}@{display}": mean for display in "ab" for label, mean in (("old", 17.0), ("hil, 5", 18.0))}
    means |= {"hil, 10@a": 19.0, "hil, 10@b": 16.0, "hil, 5@b": 15.0}
    labels = [key.partition("@")[0] for key in means]
    text = answer(
        results_of(
            means,
            names={label: label.split(",")[0] for label in labels},
            captures={label: int(label.split(", ")[1]) for label in labels if "," in label},
            camera=frozenset(label for label in labels if "," in label),
        )
    )
    assert "has 17.05 dB on a (fewer may do): hil 40" in text
    assert "Worse than old on b, captures in total: hil with 40 and 80." in text
    assert "What more captures change on b" in text
    assert "The best row on a is hil, 10 with 80 captures" in text


def prediction(**changes: Any) -> Results:
    means = {"old": 20.0, "new": 22.0, "poor": 15.0, "nothing": 18.0}
    given = {
        "measure": "prediction",
        "holograms": "wirtinger",
        "identities": frozenset({"nothing"}),
        "trained": frozenset(means),
        "reported": {"old": {"psnr": 30.0}, "new": {"psnr": 25.0}},
    }
    return results_of(means, **(given | changes))


def test_predictions_are_held_against_the_published_order_and_the_ideal_image() -> None:
    assert name_of(prediction()) == "prediction"
    text = answer(prediction())
    assert "The paper reports old first (30 dB)" in text
    assert "another order here, where it is number 2 of 2 (20.05 dB)" in text
    assert (
        "poor predicts worse than the ideal image, what ideal optics would make of the hologram; it takes no "
        "training and scores 18.05 dB." in text
    )
    same = prediction(reported={"new": {"psnr": 30.0}, "old": {"psnr": 25.0}})
    assert "the same order (22.05 dB)" in answer(same)


def with_control(found: Results, values: dict[str, float]) -> Results:
    return Results(found.frame.assign(control=found.frame["label"].map(values), control_most=0.95), found.layout)


def test_who_leads_by_control_is_held_against_who_predicts_best_else_against_the_next() -> None:
    values = {"old": 0.4, "new": 0.11, "poor": 0.74, "nothing": -0.2}
    found = with_control(prediction(), values)
    assert (
        "poor leads on bench with 0.740 of 0.950 that noise allows, before new, which predicts best, with 0.110."
        in answer(found)
    )
    header, _, first, *_ = str(kind_of(found).table(found)).splitlines()
    assert "| control |" in header
    assert "| 0.110 |" in first
    best = answer(with_control(prediction(), values | {"new": 0.9}))
    assert "new leads on bench with 0.900 of 0.950 that noise allows, before poor with 0.740." in best
    assert "control" not in answer(prediction())


def test_an_error_budget_gives_the_control_of_its_models_alone() -> None:
    found = with_control(budget_of_errors.results(), {"terms": 0.5, "network": 0.1, "field": 0.9})
    assert "field leads on ideal with 0.900 of 0.950 that noise allows, before " in answer(found)
    rows = [line.split(" | ") for line in str(kind_of(found).table(found)).splitlines()]
    control = {row[1]: row[-1] for row in rows if len(row) > 1}
    assert control["explained by"].startswith("control")
    assert control["field"].startswith("0.900")
    assert control["the ideal image"].startswith("–")
    assert control["temporal noise"].startswith("–")


def test_a_learned_display_has_an_answer_of_its_own() -> None:
    found = results_of({"old": 17.0, "new": 19.0}, learned_display="bench")
    assert name_of(found) == "learned_display"
    assert answer(found).startswith("new: on bench better than old by +2.00 dB")


def sweep(**changes: Any) -> Results:
    layout = synthetic.layout(**(vars(sweeps.layout()) | changes))
    return Results(records_frame(sweeps.records(), layout), layout)


def test_a_sweep_says_the_worst_loss_and_where_a_lead_ends() -> None:
    without = tuple(swept for swept in sweeps.layout().sweeps if "eye" not in swept.kind)
    pairs = [pair for pair in sweeps.layout().pairs if "eye" not in pair[1]]
    frame = sweep().frame
    layout = synthetic.layout(**(vars(sweeps.layout()) | {"sweeps": without, "pairs": tuple(pairs)}))
    found = Results(frame[~frame["condition"].str.contains("eye")].reset_index(drop=True), layout)
    assert name_of(found) == "sweeps"
    text = answer(found)
    assert (
        "The largest mean loss of HIL is on leto-aged +9.00 dB [+9.00, +9.00] (drift since calibration, 90 days)"
        in text
    )
    assert "90 days), then camera moved sideways " in text
    assert "; drift since calibration is shown to cost it more than 1 dB" in text
    assert (
        "HIL on leto-aged, +4.00 dB [+4.00, +4.00] before any change, lost on average under some change of drift"
        in text
    )


def test_a_remedy_says_which_share_of_the_loss_it_recovers() -> None:
    text = answer(sweep(baseline="HIL"))
    assert "The largest mean loss of HIL is on leto-aged +8.00 dB" in text
    assert "this share is recovered (the same eye, known to the methods): on leto-aged 88 [88, 88] % at -2." in text


def test_refocusing_says_how_far_a_lens_moves_the_picture() -> None:
    points = tuple((value, f"bench, refocus {value:g} mm") for value in (-2.0, 1.0, 2.0))
    loss = {"old": 0.3, "new": 2.0}
    means = {f"{label}@bench": 20.0 for label in loss}
    means |= {f"{label}@{name}": 20.0 - loss[label] * abs(value) for label in loss for value, name in points}
    found = results_of(means, sweeps=(Swept("refocus", "bench", points),))
    first, second, third = kind_of(found).answer(found)
    assert "at most 1 dB, from and to: on bench -2 or less to 2 or more mm (old) and nowhere (new)." in first
    assert "The largest mean loss of old is on bench +0.60 dB [+0.60, +0.60] (image moved by a lens phase" in second
    assert third.startswith("The best mean PSNR")
    assert third.endswith("on bench old before any change and at both ends of each.")


def test_a_sweep_that_asks_of_no_method_names_the_leader_at_both_ends() -> None:
    points = tuple((value, f"bench, refocus {value:g} mm") for value in (-2.0, 1.0, 2.0))
    scores = {"old": (20, 20, 20, 20), "new": (21, 22, 20.5, 18), "third": (20.5, 17, 20, 19)}
    names = ("bench", *(name for _, name in points))
    means = {
        f"{label}@{name}": float(value) for label in scores for name, value in zip(names, scores[label], strict=True)
    }
    found = results_of(means, sweeps=(Swept("refocus", "bench", points),))
    text = answer(found)
    assert "on bench new before any change, old at 2 mm (image moved by a lens phase" in text
    asked = results_of(means, sweeps=(Swept("refocus", "bench", points),), question="What does it cost third?")
    assert "before any change, old at" not in answer(asked)


def ranked() -> Results:
    records, layout = ranks.study(ranks.FLIPPING)
    return Results(records_frame(records, layout), layout)


def test_rank_stability_says_its_tau_and_what_turns_the_order() -> None:
    assert name_of(ranked()) == "ranks"
    text = answer(ranked())
    assert re.search(r"\(1: the same order, 0: unrelated\) is 0\.\d\d \[0\.\d\d, 0\.\d\d\] on average", text)
    assert "robust ranks first on leto-aged and in " in text
    assert "favours robust over steady (rho 1.00)" in text


def focused() -> Results:
    return focus.results_of({"lens": 20.0, "joint": 18.0})


def test_focus_compares_one_hologram_of_all_planes_with_one_a_plane() -> None:
    assert name_of(focused()) == "focus"
    text = answer(focused())
    assert "joint, one hologram of all planes: on bench" in text
    assert "-3.33 dB" in text
    assert "taking 0.83 times its computing time per scene." in text


def test_an_error_budget_names_every_part_and_what_removing_it_would_gain() -> None:
    text = answer(budget_of_errors.results())
    for part in ("the ideal image", "terms", "network", "field", "unexplained", "temporal noise"):
        assert re.search(rf"{part} -?\d+ \[", text), part
    assert (
        "with field, which no hologram reaches (means over images, which do not follow from the mean shares)." in text
    )


STUDIES = {
    "comparison": lambda: results_of(COMPARED),
    "prediction": prediction,
    "sweeps": sweep,
    "ranks": ranked,
    "focus": focused,
    "error_budget": budget_of_errors.results,
}


@pytest.mark.parametrize("study", STUDIES)
def test_an_answer_is_short_its_table_narrow_and_both_without_nan(study: str) -> None:
    found = STUDIES[study]()
    kind = kind_of(found)
    assert name_of(found) == study
    sentences = kind.answer(found)
    assert 1 <= len(sentences) <= MOST_SENTENCES
    header = str(kind.table(found)).splitlines()[0]
    assert header.count("|") - 1 <= MOST_COLUMNS
    assert "nan" not in " ".join(sentences).split()
    assert kind.question.endswith("?")


def test_a_long_answer_says_where_the_rest_of_it_stands() -> None:
    kind = replace(KINDS[-1], sentences=lambda results: (f"Finding {number} of old." for number in range(7)))
    found = results_of({"old": 20.0})
    assert kind.answer(found) == [
        *(f"Finding {number} of old." for number in range(4)),
        "3 more findings are in the first section of details.md.",
    ]
    assert len(kind.whole_answer(found)) == 7


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.sentences.__module__.rpartition(".")[2])
def test_a_study_without_a_score_has_no_answer(kind: Any) -> None:
    empty = results_of({"old": np.nan, "new": np.nan})
    lost = empty.frame.assign(state="failed")
    assert kind.answer(Results(lost, empty.layout)) == ["No cell of the study has a score, so there is no answer."]
