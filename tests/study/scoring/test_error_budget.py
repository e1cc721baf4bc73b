"""Error budgets of displays of which is known what spoils their pictures."""

from functools import partial
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.methods.calibrated import patterns
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.report import facts_of
from holobench_eval.report.results import Results, records_frame
from holobench_eval.report.stories.error_budget import Budget, budgets
from holobench_eval.study.config import load_study
from tests.study.studies import write_ideal_green
from tests.support.studies.trained_study import computed, write

SHADED = "stray_light: {share: 0.3, reach: 0.2}\nsensor: {pitch: 3.72e-6, vignetting: 0.3, noise: true, read_noise: 60}"
UNMODULATED = "zero_order: {fraction: 0.1, phase: 0.5}\nsensor: {pitch: 3.72e-6, noise: true, read_noise: 60}"
METHODS = """[
  {name: image_terms, params: {start: {iterations: 20}, training: {steps: 200}}},
  {name: image_network, profiles: [unmodulated.yaml], params: {start: {iterations: 20}, training: {steps: 20}}},
  {name: field_network, profiles: [unmodulated.yaml], params: {start: {iterations: 20}, training: {steps: 120}}}]"""
STUDY = (
    ("seed: 3", "seed: 3\nmeasure: error_budget\nprotocol: {metrics: [psnr, ssim, control]}"),
    ("methods:", "holograms: {params: {iterations: 20}}\nmethods:"),
    ("{profiles: [ideal], panel: [128, 128]}", "{profiles: [shaded.yaml, unmodulated.yaml]}"),
    ("count: 1}", "count: 2}"),
    ('"trained.py:Unseen", held_out: 1}', '"trained.py:Unseen", params: {count: 7}, held_out: 2}'),
    ('["trained.py:Gain"]', METHODS),
)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """The budgets of both displays by name, and the records they come from."""
    folder = tmp_path_factory.mktemp("budget")
    config = write(folder, *STUDY)
    for name, effect in (("shaded", SHADED), ("unmodulated", UNMODULATED)):
        write_ideal_green(folder, name, effect)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(patterns, "Wirtinger", partial(Wirtinger, iterations=20))  # as all other holograms here
        records = computed(config)
    facts = facts_of(load_study(config))
    return {item.condition: item for item in budgets(Results(records_frame(records, facts), facts))}, records


def interferes(record: dict[str, Any], target: str = "") -> bool:
    """Whether a record is of the display whose light interferes, and of a target."""
    return record["cell"]["profile"] == "unmodulated" and target in record["cell"]["target"]


def share(budget: Budget, label: str) -> float:
    return next(part.share.mean for part in budget.parts if part.label == label)


def test_image_terms_explain_shading_and_haze_down_to_the_noise(found):
    budget = found[0]["shaded"]
    assert share(budget, "image_terms") > 0.7
    assert abs(share(budget, "unexplained")) < 0.1
    assert 0.005 < share(budget, "temporal noise") < 0.3


def test_light_that_interferes_is_left_to_the_field(found):
    budget = found[0]["unmodulated"]
    assert share(budget, "field_network") > 0.5
    assert share(budget, "image_terms") + share(budget, "image_network") < 0.4
    *_, network, field = budget.explained
    assert field.gain.mean > network.gain.mean + 3
    assert budget.noise.gain.mean > field.gain.mean - 0.5


def test_only_a_model_of_the_field_controls_light_that_interferes(found):
    control = {
        label: [record["scores"]["control"] for record in found[1] if record["label"] == label and interferes(record)]
        for label in ("image_terms", "image_network", "field_network")
    }
    assert min(control["field_network"]) > max(control["image_terms"] + control["image_network"])


def test_all_methods_are_given_the_same_capture_and_the_same_noise(found):
    shared = ("unexplained_by_target", "unexplained_by_ideal_image", "unexplained_but_noise", "error_of_ideal_image")
    for target in ("picture 0", "picture 1"):
        same = [r["scores"] for r in found[1] if "unexplained" in r["scores"] and interferes(r, target)]
        assert len(same) == 3
        assert all(len({scores[name] for scores in same}) == 1 for name in shared)


def test_what_is_unexplained_is_the_error_of_the_prediction_in_the_light_of_the_target(found):
    for record in found[1]:
        scores = record["scores"]
        if "unexplained" in scores and scores["unexplained_by_target"] < 0.02:
            error = 10 ** (-scores["psnr_linear"] / 10)  # with the protocol's clip, and dimmed by its match
            assert error == pytest.approx(scores["unexplained"], rel=0.15)


def test_the_predictions_of_the_shipped_config_learn_from_holograms_of_the_kind_that_is_split():
    study = load_study(Path(__file__).parents[3] / "configs" / "error-budget.yaml")
    assert study.holograms.name == "wirtinger"
    assert all(entry.params["start"] == dict(study.holograms.params) for entry in study.methods)
    assert all(entry.params["search"]["iterations"] == 0 for entry in study.methods)
