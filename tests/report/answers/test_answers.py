"""What each kind of study answers, from made-up records whose answer is known, and how far an answer goes."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from holobench_eval.report import Results, records_frame
from holobench_eval.report.answers import KINDS, ablation, budget, comparison, error_budget, kind_of
from holobench_eval.report.answers import focus as focus_kind
from holobench_eval.report.answers import prediction as prediction_kind
from holobench_eval.report.answers import ranks as ranks_kind
from holobench_eval.report.answers import sweeps as sweeps_kind
from holobench_eval.report.answers.kind import MOST_WORDS, Kind, subjects
from holobench_eval.report.answers.limits import limits
from holobench_eval.report.board import board
from holobench_eval.report.facts import CALIBRATED, OPEN_LOOP, Swept
from holobench_eval.report.description import Description
from holobench_eval.report.section import Report
from holobench_eval.study.definition import Claim
from holobench_eval.study.plan import REFERENCE, is_reference, reference_of
from tests.report.data import test_error_budget as budget_of_errors
from tests.report.sections import test_ranks as ranks
from tests.report.sections import test_sweeps as sweeps
from tests.report.sections import test_tables as focus
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
    given = {"pairs": tuple(pairs), "targets": TARGETS, "baseline": "old", "privileged": frozenset({"oracle"})}
    return synthetic.results(records, **(given | changes))


def answer(results: Results) -> str:
    return "\n".join(kind_of(results).answer(results))


def shown(results: Results) -> str:
    return str(kind_of(results).table(board(results)))


COMPARED = {"old": 17.0, "new": 19.0, "other": 20.0, "oracle": 25.0, "floor_constant": 15.0}


def test_a_verdict_a_display_says_who_leads_and_by_how_much() -> None:
    means = {"old@a": 17.0, "new@a": 19.0, "old@b": 17.0, "new@b": 17.0}
    found = results_of(means, noise=lambda label: NOISE if label == "old" else -NOISE)
    first, second = kind_of(found).answer(found)
    assert first == "a: new leads (18.95 dB), +1.90 dB [+1.49, +2.31] against old."
    assert second == "b: old and new lead, not told apart (17.05 dB)."


def test_a_method_of_the_question_is_told_with_its_published_margin() -> None:
    reported = {"new": {"psnr": 20.5}, "old": {"psnr": 17.6}}
    text = answer(results_of(COMPARED, question="Is new better?", reported=reported))
    assert text.startswith("other leads (20.05 dB), +3.00 dB [+3.00, +3.00] against old;")
    assert text.endswith("new +2.00 dB [+2.00, +2.00] (published +2.90 dB).")


def test_those_without_a_camera_and_those_with_one_at_the_picture_are_told_apart() -> None:
    means = {"old": 17.0, "plain": 18.0, "trained": 20.0, "watching": 22.0}
    captures = {"trained": 5, "watching": 5}
    text = answer(results_of(means, None, captures, trained=frozenset({"trained"}), camera=frozenset({"watching"})))
    assert text.startswith("trained leads (20.05 dB), +3.00 dB [+3.00, +3.00] against old, for 40 photographs; without")
    assert "without a camera plain leads (18.05 dB), +1.00 dB [+1.00, +1.00]; with photographs of the picture" in text
    assert text.endswith("itself watching leads (22.05 dB), +5.00 dB [+5.00, +5.00], for 40 photographs.")


def test_a_network_that_was_trained_without_photographs_stands_among_those_without_a_camera() -> None:
    networks = frozenset({"net", "trained"})
    means = {"old": 17.0, "net": 18.0, "trained": 16.0}
    found = results_of(means, None, {"trained": 5}, trained=networks, blind=frozenset({"net"}))
    assert answer(found) == "net leads (18.05 dB), +1.00 dB [+1.00, +1.00] against old."
    groups = {row.label: group for display in board(found).displays for group, rows in display.groups for row in rows}
    assert groups == {"net": OPEN_LOOP, "old": OPEN_LOOP, "trained": CALIBRATED}


@pytest.mark.parametrize(
    ("better", "among"), [("camera", "photographs of the picture itself"), ("privileged", "knowing the display")]
)
def test_who_leads_below_a_baseline_of_another_group_leads_among_the_others(better: str, among: str) -> None:
    found = results_of({"old": 20.0, "plain": 16.0}, **{better: frozenset({"old"})})
    assert answer(found).startswith(f"without {among} plain leads (16.05 dB), -4.00 dB")


def test_the_board_has_tiers_differences_and_the_oracle_apart() -> None:
    table = shown(results_of(COMPARED))
    assert "| A | other | 20.05 | +3.00 [+3.00, +3.00] |" in table
    assert "| C | old | 17.05 | baseline |" in table
    assert "|  | oracle | 25.05 | +8.00 [+8.00, +8.00] |" in table
    assert "A gray picture scores 15.05 dB." in table
    poor = results_of({"old": 14.0, "new": 19.0, "floor_constant": 15.0})
    assert "| B | old, no better than gray | 14.05 |" in shown(poor)


def test_each_display_is_held_against_its_own_floor() -> None:
    means = {"old@a": 17.0, "new@a": 19.0, "old@b": 17.0, "new@b": 19.0, "floor_constant": 16.0}
    table = shown(results_of(means | {"floor_constant@b": 18.0}))
    assert "A gray picture scores 16.05 dB on a; 18.05 dB on b." in table
    assert table.count("no better than gray") == 1


def test_ms_ssim_and_brightness_stand_beside_psnr() -> None:
    found = results_of({"old": 17.0, "new": 19.0})
    frame = found.frame.assign(ms_ssim_linear=found.frame["label"].map({"old": 0.8, "new": 0.7}), brightness_ratio=0.25)
    table = shown(Results(frame, found.layout))
    assert "| MS-SSIM | brightness ratio |" in table
    assert "| 0.700 | 0.250 |" in table


def test_a_method_that_lacks_a_target_has_no_letter_and_is_named_with_its_remedy() -> None:
    found = results_of({"old": 17.0, "new": 19.0, "other": 18.0}, question="Is new better?")
    hole = found.frame[(found.frame["label"] != "new") | (found.frame["target"] != TARGETS[0])].reset_index(drop=True)
    holed = Results(hole, found.layout)
    first, second = kind_of(holed).answer(holed)
    assert first == "other leads (18.05 dB), +1.00 dB [+1.00, +1.00] against old."
    assert "new lacks 1 of 8 targets (t0)" in second
    assert "name the other 7 targets with --targets to rank all by these" in second
    assert "|  | new, 7 of 8 targets | 19.06 | – |" in shown(holed)


def test_two_targets_are_not_tested_and_have_no_letters() -> None:
    few = results_of(COMPARED)
    layout = replace(few.layout, targets=TARGETS[:2])
    found = Results(few.frame[few.frame["target"].isin(TARGETS[:2])].reset_index(drop=True), layout)
    assert answer(found) == "other leads (20.15 dB), +3.00 dB against old, untested."
    assert "|  | other | 20.15 | +3.00 (no test) |" in shown(found)


def test_a_name_that_begins_another_is_not_taken_for_it() -> None:
    means = {"old": 17.0, "old, tuned": 18.0, "new": 19.0, "new_plus": 20.0}
    assert subjects(results_of(means, question="Is new_plus, or old, tuned, better?")) == ["new_plus", "old, tuned"]


def test_a_baseline_of_another_display_leaves_no_budget_to_answer() -> None:
    captures = {"few": 10, "many": 90}
    found = results_of({"few@a": 17.0, "many@a": 19.0, "old@b": 17.0}, {"few": "online", "many": "online"}, captures)
    assert kind_of(found) is comparison.KIND
    assert answer(found)


def test_an_ablation_says_what_lowers_and_raises_the_score() -> None:
    means = {"old": 19.0, "no loss": 17.0, "more rounds": 19.0, "no skip": 18.5, "another": 30.0}
    found = results_of(
        means,
        names=dict.fromkeys(("old", "no loss", "more rounds", "no skip"), "hil"),
        noise=lambda label: -NOISE if label == "more rounds" else NOISE,
    )
    assert kind_of(found) is ablation.KIND
    assert answer(found) == "Of 3 changes of old, 2 lower it: no loss (-2.00) and no skip (-0.50); none raise it."


def test_an_ablation_holds_its_changes_against_those_of_another_seed() -> None:
    means = {"old": 19.0, "no loss": 17.0, "no skip": 18.9, "reseeded": 18.5}
    found = results_of(means, names=dict.fromkeys(means, "hil"))
    params = {label: {"seed": int(label == "reseeded"), "skip": label != "no skip"} for label in means}
    text = answer(Results(found.frame, replace(found.layout, params=params)))
    assert text.startswith("Of 2 changes of old")
    assert text.endswith("Another seed moves it by 0.50 dB: what is smaller is chance.")


def spent(means: dict[str, float]) -> Results:
    """A study of methods that take as many photographs of each picture as stand behind their comma."""
    captures = {label: int(label.split(", ")[1]) for label in means if "," in label}
    return results_of(means, {label: label.split(",")[0] for label in means}, captures, camera=frozenset(captures))


def test_a_budget_names_the_fewest_photographs_that_pass_and_who_never_does() -> None:
    means = {"old": 17.0, "good, 5": 16.0, "good, 10": 18.0, "good, 20": 19.0, "bad, 5": 15.0, "bad, 10": 16.0}
    assert kind_of(spent(means)) is budget.KIND
    fewest, best = answer(spent(means)).split(" Best: ")
    assert fewest == "Fewest photographs, of those tried, that beat old: good 80; never: bad."
    assert best == "good, 20 with 160, 19.05 dB."
    none = answer(spent({"old": 17.0, "bad, 5": 15.0, "bad, 10": 16.0}))
    assert none.startswith("With no number of photographs, of those tried, bad is shown to beat old. Best: old")


def prediction(**changes: Any) -> Results:
    means = {"old": 20.0, "new": 22.0, "poor": 15.0, "nothing": 18.0}
    given = {
        "measure": "prediction",
        "holograms": "wirtinger",
        "identities": frozenset({"nothing"}),
        "trained": frozenset(means),
        "reported": {"old": {"psnr": 30.0}, "new": {"psnr": 25.0}},
        "question": "Does poor predict best?",
    }
    return results_of(means, **(given | changes))


def test_predictions_are_held_against_the_baseline_and_the_published_order() -> None:
    assert answer(prediction()).startswith("new predicts best (22.05 dB); than old, worse: poor;")
    assert answer(prediction()).endswith("old, published as first of 2, is number 2.")
    assert "poor, not trained to convergence: below the ideal image" in shown(prediction())


def with_control(found: Results, values: dict[str, float]) -> Results:
    return Results(found.frame.assign(control=found.frame["label"].map(values), control_most=0.95), found.layout)


def test_control_is_told_beside_predictions_and_of_the_models_of_an_error_budget_alone() -> None:
    found = with_control(prediction(), {"old": 0.4, "new": 0.11, "poor": 0.74, "nothing": -0.2})
    assert "new predicts best (22.05 dB); poor answers changes best (control 0.740 of 0.950)" in answer(found)
    assert "| 0.110 |" in shown(found)
    assert "control" not in answer(prediction())
    budgets = with_control(budget_of_errors.results(), {"terms": 0.5, "network": 0.1, "field": 0.9})
    rows = [line.split(" | ") for line in shown(budgets).splitlines()]
    control = {row[1]: row[-1][:5] for row in rows if len(row) > 1}
    assert control["field"] == "0.900"
    assert control["the ideal image"][0] == control["temporal noise"][0] == "–"


def test_a_learned_display_has_a_question_of_its_own() -> None:
    found = results_of({"old": 17.0, "new": 19.0}, learned_display="bench")
    assert kind_of(found) is comparison.ON_A_NETWORK


def sweep(**changes: Any) -> Results:
    layout = synthetic.layout(**(vars(sweeps.layout()) | changes))
    return Results(records_frame(sweeps.records(), layout), layout)


WITHOUT_EYES = tuple(swept for swept in sweeps.layout().sweeps if "eye" not in swept.kind)


def claimed(claim: Claim) -> Results:
    changed = tuple(replace(swept, claim=claim) for swept in sweeps.layout().sweeps if swept.kind == "drift")
    return sweep(sweeps=changed, question="Does HIL stay?")


def test_a_sweep_says_the_worst_loss_and_whether_a_lead_stays() -> None:
    text = answer(sweep(sweeps=WITHOUT_EYES, question="Does HIL stay?"))
    assert text.startswith("HIL loses at most +9.00 dB [+9.00, +9.00] (drift since calibration, 90 days);")
    assert text.endswith("its lead over Wirtinger is lost, -5.00 dB at least.")


def test_a_sweep_whose_baseline_is_best_tells_of_another_method_too() -> None:
    best, other = answer(sweep(sweeps=WITHOUT_EYES, baseline="HIL")).splitlines()
    assert best.startswith("HIL loses at most +9.00 dB")
    assert other.startswith("Wirtinger loses at most +0.00 dB")
    assert other.endswith("with no lead over HIL before (-4.00 dB).")


def test_a_claim_is_judged_as_far_as_it_goes() -> None:
    whole = answer(claimed(Claim("Nothing happens")))
    assert '"Nothing happens" does not hold for HIL: it loses at most +9.00 dB' in whole
    assert '"Nothing happens" cannot be judged' in answer(claimed(Claim("Nothing happens", until=1.0)))


def test_a_remedy_says_which_share_of_the_loss_it_gives_back() -> None:
    assert answer(sweep(baseline="HIL")) == "the same eye, known to the methods gives back 88 [88, 88] %."
    assert "gives back nothing, as no eye loses more than 1 dB." in answer(sweep())


def test_places_of_a_pupil_say_which_methods_are_above_the_baseline_at_each() -> None:
    points = tuple((place, f"bench, eye pupil {place}") for place in ("0", "0.5"))
    means = {"old@bench": 30.0, "new@bench": 20.0, "other@bench": 20.0}
    for (_, name), values in zip(points, ((22.0, 21.0, 20.0), (15.0, 19.0, 17.0)), strict=True):
        means |= {f"{label}@{name}": value for label, value in zip(("old", "new", "other"), values, strict=True)}
    text = answer(results_of(means, sweeps=(Swept("eye_pupil", "bench", points),), baseline="old"))
    assert text.startswith("above old by intervals, for an eye whose pupil is aside, in radii of the iris: at 0 none, ")
    assert re.search(r"none, at best new -1\.00 dB \[[^]]*\]; at 0\.5 new \+4\.00 dB", text)
    assert text.endswith(", other +2.00 dB.")


def test_refocusing_says_how_far_a_lens_moves_the_picture() -> None:
    points = tuple((value, f"bench, refocus {value:g} mm") for value in (-2.0, 1.0, 2.0))
    loss = {"old": 0.3, "new": 2.0}
    means = {f"{label}@bench": 20.0 for label in loss}
    means |= {f"{label}@{name}": 20.0 - loss[label] * abs(value) for label in loss for value, name in points}
    text = answer(results_of(means, sweeps=(Swept("refocus", "bench", points),)))
    assert text.endswith("a lens moves the picture for at most 1 dB: -2 or less to 2 or more mm (old), nowhere (new).")


def ranked() -> Results:
    records, layout = ranks.study(ranks.FLIPPING)
    return Results(records_frame(records, layout), layout)


def test_rank_stability_says_who_stays_first_its_tau_and_who_turns() -> None:
    first, tau, turn = answer(ranked()).split("; ")
    assert first == "robust, first on leto-aged, is first on 50 [33, 67] % of its draws"
    assert tau == "Kendall's tau with its ranking is 0.67 [0.54, 0.79]"
    assert turn == "steady passes robust most often, on 50 [33, 67] %."


def focused() -> Results:
    return focus.results_of({"lens": 20.0, "joint": 18.0})


def test_focus_compares_one_hologram_of_all_planes_with_one_a_plane() -> None:
    assert answer(focused()) == "bench, against lens: joint (of all planes) -3.33 dB [-4.10, -2.56]."
    assert answer(focus.results_of({"joint": 18.0}, baseline=None)) == "bench: joint 16.87 dB."


def test_an_error_budget_names_every_part_and_what_removing_it_would_gain() -> None:
    parts, gains = answer(budget_of_errors.results()).split("; ")
    assert parts.startswith("the error is explained by the ideal image")
    assert parts.endswith("ideal image 5 %, terms 28 %, network 5 %, field 46 %, unexplained 11 %, temporal noise 4 %")
    assert gains == "at most +2.3 dB with network and +8.1 dB with field."


STUDIES = {
    comparison.KIND: lambda: results_of(COMPARED),
    prediction_kind.KIND: prediction,
    sweeps_kind.KIND: sweep,
    ranks_kind.KIND: ranked,
    focus_kind.KIND: focused,
    error_budget.KIND: budget_of_errors.results,
}


@pytest.mark.parametrize("kind", STUDIES, ids=lambda kind: kind.verdicts.__module__.rpartition(".")[2])
def test_a_verdict_is_short_and_without_nan(kind: Kind) -> None:
    found = STUDIES[kind]()
    assert kind_of(found) is kind
    for verdict in kind.answer(found):
        assert len(verdict.split()) <= MOST_WORDS
        assert "nan" not in verdict.split()
    assert kind.table(board(found))
    assert kind.question.endswith("?")


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.verdicts.__module__.rpartition(".")[2])
def test_a_study_without_a_score_has_no_answer(kind: Kind) -> None:
    empty = results_of({"old": np.nan, "new": np.nan})
    lost = empty.frame.assign(state="failed")
    assert kind.answer(Results(lost, empty.layout)) == ["No cell of the study has a score, so there is no answer."]


def told(alone: tuple[str, ...] = (), provenance: dict[str, Any] | None = None, **changes: Any) -> str:
    """The limits of a study; alone: targets that were solved with nothing beside them."""
    records = [
        synthetic.record(label, synthetic.cell(label, target, "ideal"), {"psnr_linear": 20.0}, alone=target in alone)
        for label in ("GS", "Wirtinger")
        for target in synthetic.TARGETS
    ]
    results = synthetic.results(records, **changes)
    report = Report(results, records, Path("none"), provenance or {}, Description())
    return "\n".join(limits(report, kind_of(results)))


@pytest.mark.parametrize(
    ("alone", "workers", "expected"),
    [
        (synthetic.TARGETS[:1], 2, "**Seconds:** of holograms that were solved with nothing beside them."),
        ((), 2, "**Seconds:** of 2 workers side by side, so longer than alone."),
        ((), 1, ""),
    ],
)
def test_a_reader_is_told_what_was_at_work_beside_what_was_timed(alone, workers, expected) -> None:
    text = told(alone, {"workers": workers})
    assert expected in text
    assert ("**Seconds:**" in text) == bool(expected)


@pytest.mark.parametrize(("wanted", "missed"), [(None, True), (("psnr", "lpips_alex"), True), (("psnr",), False)])
def test_lpips_is_missed_only_where_it_was_wanted(wanted: tuple[str, ...] | None, missed: bool) -> None:
    assert ("**LPIPS:**" in told(metrics=wanted)) == missed
