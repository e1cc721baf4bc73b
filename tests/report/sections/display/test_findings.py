import numpy as np
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.report import Results, csv_text, records_frame
from holobench_eval.report.data.tables import read_records
from holobench_eval.report.sections.display.findings import findings
from holobench_eval.study.plan import REFERENCE
from tests.support import synthetic_study as synthetic

TARGETS = tuple(f"t{index}" for index in range(8))
NOISE = np.array([0.0, 0.3, -0.2, 0.1, 0.4, -0.1, 0.2, -0.3])


def results_of(scores, targets=TARGETS, **changes):
    """Results of methods given as {label: {score key: values over targets}}; a floor is a label floor_..."""
    records = []
    for label, columns in scores.items():
        condition = REFERENCE if label.startswith("floor_") else "bench"
        for index, target in enumerate(targets):
            found = {key: float(values[index]) for key, values in columns.items() if not np.isnan(values[index])}
            state = {"state": "done"} if found else {"state": "failed", "reason": "lost"}
            records.append(synthetic.record(label, synthetic.cell(label, target, condition), found, **state))
    labels = tuple((label, "bench") for label in scores if not label.startswith("floor_"))
    given = {"pairs": labels, "targets": targets, "baseline": "old", "reported": {}, "privileged": frozenset()}
    layout = synthetic.layout(**(given | changes))
    return Results(records_frame(records, layout), layout)


def psnr(mean):
    return {"psnr_linear": mean + NOISE}


def sentences(results):
    return {heading: " ".join(lines) for heading, lines in findings(results)}


def test_the_best_method_is_named_with_its_margin_interval_and_p():
    text = sentences(results_of({"old": psnr(17.0), "new": {"psnr_linear": 19.0 + 2 * NOISE}}))["bench"]
    assert "new ranks first of 2 methods: PSNR 19.10" in text
    assert "Difference from the baseline old (17.05 dB): +2.05 dB [" in text
    assert "8 of 8 targets, p = 0.008." in text
    assert "Against the baseline old, at p < 0.05 adjusted for all 1 comparisons of the study: better: new." in text
    assert "not shown" not in text


def test_when_the_baseline_wins_the_next_method_is_compared_with_it():
    text = sentences(results_of({"old": psnr(20.0), "mid": psnr(19.0), "low": psnr(15.0)}))["bench"]
    assert "The baseline old ranks first of 3 methods: PSNR 20.05" in text
    assert "mid follows at -1.00 dB [" in text
    assert "of the study: worse: mid and low." in text


def test_differences_are_also_given_to_a_second_baseline_where_the_study_names_one():
    scores = {"old": psnr(17.0), "strong": psnr(18.0), "new": psnr(19.0), "oracle": psnr(30.0)}
    privileged = frozenset({"oracle"})
    text = sentences(results_of(scores, second_baseline="strong", privileged=privileged))["bench"]
    assert "the second baseline, strong (18.05 dB), untested: new +1.00 dB [+1.00, +1.00]; old -1.00 dB" in text
    assert "second baseline" not in sentences(results_of(scores, privileged=privileged))["bench"]


def test_a_privileged_method_is_the_oracle_and_never_the_best():
    scores = {"old": psnr(17.0), "new": psnr(18.0), "oracle": psnr(30.0)}
    found = results_of(scores, privileged=frozenset({"oracle"}))
    text = sentences(found)["bench"]
    assert "new ranks first of 2 methods" in text
    assert "The privileged method oracle, an oracle that may differentiate" in text
    assert "+12.00 dB [+12.00, +12.00] from new" in text
    assert [test.second for test in found.against_baseline if np.isfinite(test.p)] == ["new"]


def test_a_method_that_does_not_beat_a_constant_image_is_named():
    text = sentences(results_of({"old": psnr(17.0), "bad": psnr(14.0), "floor_constant": psnr(15.5)}))["bench"]
    assert "a constant image scores 15.55 dB; not better on average: bad." in text


def test_a_method_with_a_hole_is_not_ranked_and_said_so():
    lucky = {"psnr_linear": np.where(np.arange(8) == 3, np.nan, 25.0)}
    text = sentences(results_of({"old": psnr(17.0), "new": psnr(18.0), "lucky": lucky}))["bench"]
    assert "new ranks first of 2 methods" in text
    assert "Not ranked, because targets are missing: lucky (7 of 8)" in text


def test_a_baseline_without_a_score_is_not_compared_with():
    text = sentences(results_of({"old": {"psnr_linear": np.full(8, np.nan)}, "new": psnr(18.0)}))["bench"]
    assert "new is the only ranked method: PSNR 18.05" in text
    assert "Difference from the baseline" not in text
    assert "–" not in text
    assert "Not ranked, because targets are missing: old (0 of 8)" in text


def test_a_ranking_that_blur_flips_is_reported_with_the_width():
    sharp = {"psnr_linear": 18 + NOISE, "psnr_linear_blur0.5": 19 + NOISE, "psnr_linear_blur1": 20 + NOISE}
    noisy = {"psnr_linear": 17 + NOISE, "psnr_linear_blur0.5": 18 + NOISE, "psnr_linear_blur1": 22 + NOISE}
    text = sentences(results_of({"old": sharp, "noisy": noisy}))["bench"]
    assert "The ranking depends on the blur width: at 1 px noisy above old." in text


def test_a_stable_ranking_is_reported_as_stable():
    both = {label: psnr(mean) | {"psnr_linear_blur1": mean + 3 + NOISE} for label, mean in (("old", 17), ("new", 18))}
    assert "The order of the 2 ranked methods is the same" in sentences(results_of(both))["bench"]


def test_a_metric_that_disagrees_with_the_headline_is_named():
    scores = {"old": psnr(17) | {"mofd_srgb": 0.1 + NOISE / 100}, "new": psnr(18) | {"mofd_srgb": 0.3 + NOISE / 100}}
    assert "old ranks first by MOFD (sRGB), ahead of new." in sentences(results_of(scores))["bench"]


def test_two_targets_give_no_test_and_say_so():
    text = sentences(results_of({"old": psnr(17.0), "new": psnr(18.0)}, targets=TARGETS[:2]))["bench"]
    assert "too few for an interval or a test" in text
    assert "No test against the baseline: fewer than 3 clusters with complete pairs." in text
    assert "p =" not in text


def test_a_test_that_could_not_have_shown_anything_says_so():
    text = sentences(results_of({"old": psnr(17.0), "new": psnr(18.0)}, targets=TARGETS[:4]))["bench"]
    assert "With 4 clusters no p can be below 0.12: no difference can be shown." in text


def test_every_method_is_tested_against_the_baseline_alone_and_all_in_one_family():
    scores = {"old": psnr(17.0), "mid": {"psnr_linear": 17.3 + NOISE[::-1]}, "new": {"psnr_linear": 17.1 - NOISE}}
    results = results_of(scores)
    assert [(t.first, t.second) for t in results.against_baseline] == [("old", "mid"), ("old", "new")]
    alone = results_of({label: scores[label] for label in ("old", "mid")}).against_baseline[0]
    assert results.against_baseline[0].p > alone.p


def test_a_difference_that_may_be_chance_is_not_shown():
    found = results_of({"old": psnr(17.0), "new": {"psnr_linear": 17.2 - NOISE}})
    text = sentences(found)["bench"]
    assert "8 of 8 targets, p = 0.672: not shown." in text
    assert "of the study: not shown to differ: new." in text


def test_a_lead_over_the_second_is_untested_and_one_that_may_be_chance_is_told():
    scores = {"old": psnr(15.0), "mid": psnr(18.0), "new": {"psnr_linear": 18.2 - NOISE}}
    text = sentences(results_of(scores))["bench"]
    assert "new ranks first of 3 methods" in text
    assert "It differs from the second, mid, by +0.10 dB [" in text
    assert "], untested, as the two were chosen by rank, and its interval holds zero." in text
    clear = sentences(results_of(scores | {"new": {"psnr_linear": 19 + NOISE}}))["bench"]
    assert "], untested, as the two were chosen by rank." in clear


def test_targets_of_one_cluster_are_counted_as_one():
    scores = {"old": psnr(17.0), "new": {"psnr_linear": 19.0 + 2 * NOISE}}
    pairs = {target: f"photograph {index // 2}" for index, target in enumerate(TARGETS)}
    found = results_of(scores, clusters=pairs)
    assert "8 of 8 targets in 4 clusters, p = 0.125: not shown" in sentences(found)["bench"]
    again = Results(read_records(csv_text(found.frame)), synthetic.layout(baseline="old"))  # from records alone
    assert again.against_baseline[0].estimate == found.against_baseline[0].estimate


def test_a_headline_that_no_record_has_is_an_error_with_a_suggestion():
    with pytest.raises(UserError, match="did you mean 'psnr_linear'"):
        _ = results_of({"old": psnr(17.0)}, headline="psnr_liner").headline


def test_a_study_without_any_score_has_no_findings_but_its_holes():
    results = results_of({"old": {"psnr_linear": np.full(8, np.nan)}})
    assert sentences(results)["bench"].startswith("No method has a score for every target, so none is ranked.")
    assert len(results.holes) == 8


def test_a_floor_without_a_score_is_not_spoken_of():
    lost = {"psnr_linear": np.full(8, np.nan)}
    results = results_of({"old": psnr(17.0), "floor_constant": lost, "floor_speckle": psnr(9.0)})
    assert results.floors == ["floor_speckle"]
    text = sentences(results)["bench"]
    assert "constant" not in text
    assert "pure speckle scores 9.05 dB; all scored methods (1) are better." in text
