"""A profile's free parameters are fitted to published figures, within the ranges of their sources."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace

import pytest

from holobench_eval.commands.own.calibrate import calibrate
from holobench_eval.core.errors import UserError
from holobench_eval.display import load_profile
from holobench_eval.study.calibration import Calibration, Prediction, load_calibration, names
from holobench_eval.study.calibration.fitting import NEAR, TRAININGS, Fitting
from holobench_eval.study.definition import Targets
from holobench_eval.study.running.progress import Lines
from tests.study.studies import one_line

FREE = {"zero_order.fraction": (0.05, 0.35), "zero_order.phase": (-3.1, 3.1)}
SMALL = Calibration(
    (128, 128), 0, Targets("photographs", {"count": 2}), {"double_phase": 12.0, "wirtinger": 14.0}, FREE
)


def fitting(
    calibration: Calibration, tell: Callable[[str], object] = lambda line: None, name: str = "leto-mild"
) -> Fitting:
    return Fitting(name, load_profile(name), calibration, Lines(lambda line: None), tell)


@pytest.mark.parametrize("name", names())
def test_a_shipped_profile_lies_within_the_ranges_of_its_calibration(name):
    profile, calibration = load_profile(name), load_calibration(load_profile(name))
    for parameter, (low, high) in calibration.free.items():
        stage, key = parameter.split(".")
        assert low < getattr(getattr(profile, stage), key) < high
    if calibration.prediction is not None:
        assert calibration.prediction.parameter in calibration.free


def test_the_fit_comes_as_near_as_two_parameters_allow_and_tells_its_trials():
    lines: list[str] = []
    fit = fitting(SMALL, lines.append)
    values, network = fit.fit()
    assert network is None
    assert all(low <= values[name] <= high for name, (low, high) in FREE.items())
    assert fit.captured(values)["wirtinger"] == pytest.approx(14.0, abs=1.5)
    assert re.match(r"zero_order.fraction 0\..*wirtinger", lines[0])


def test_a_fit_of_one_parameter_finds_it_from_captures_that_were_made_with_it():
    free = {"crosstalk.width": (0.1, 0.6)}
    fit = fitting(replace(SMALL, free=free))
    figures = fit._quick({"crosstalk.width": 0.4})
    again = fitting(replace(SMALL, free=free, figures=figures))
    assert again.fit()[0]["crosstalk.width"] == pytest.approx(0.4, abs=0.01)


def test_the_parameter_of_a_prediction_is_found_in_few_trainings(monkeypatch):
    free = {"stray_light.share": (0.05, 0.7), "crosstalk.width": (0.1, 0.6)}
    calibration = replace(SMALL, free=free, prediction=Prediction(25.0, "stray_light.share", 0.3, {}))
    asked: list[float] = []

    def predicted(_: Fitting, values: Mapping[str, float]) -> float:
        asked.append(values["stray_light.share"])
        return 18 + 15 * values["stray_light.share"] ** 1.2

    monkeypatch.setattr(Fitting, "predicted", predicted)
    monkeypatch.setattr(Fitting, "_fit_figures", lambda _, fixed: {"crosstalk.width": 0.3, **fixed})
    monkeypatch.setattr(Fitting, "_quick", lambda _, values: dict(SMALL.figures))
    found, psnr = fitting(calibration).fit()
    assert psnr == 18 + 15 * found["stray_light.share"] ** 1.2
    assert abs(psnr - 25.0) < NEAR
    assert len(asked) <= TRAININGS


MET = {0.62: (15.40, 17.49), 0.685: (15.51, 17.34), 0.7: (15.53, 17.27)}  # dB, by the share of stray light


@pytest.mark.parametrize("start", [0.62, 0.685])
@pytest.mark.parametrize(("tolerance", "best"), [(0.3, 0.685), (0.4, 0.7), (0.1, 0.62)])
def test_no_prediction_is_bought_with_figures_outside_their_tolerance(monkeypatch, start, tolerance, best):
    shipped, profile = load_calibration(load_profile("leto-hazy")), load_profile("leto-hazy")
    assert shipped.prediction is not None
    calibration = replace(shipped, prediction=replace(shipped.prediction, tolerance=tolerance))
    profile = replace(profile, stray_light=replace(profile.stray_light, share=start))
    tried: list[float] = []

    def predicted(_: Fitting, values: Mapping[str, float]) -> float:
        tried.append(values["stray_light.share"])
        return 23.96 + (24.34 - 23.96) * (tried[-1] - 0.62) / (0.685 - 0.62)  # never near enough: the range ends first

    def quick(_: Fitting, values: Mapping[str, float]) -> dict[str, float]:
        return dict(zip(("double_phase", "wirtinger"), MET[values["stray_light.share"]], strict=True))

    monkeypatch.setattr(Fitting, "predicted", predicted)
    monkeypatch.setattr(Fitting, "_quick", quick)
    monkeypatch.setattr(Fitting, "_fit_figures", lambda _, fixed: fixed)
    found, _ = Fitting("leto-hazy", profile, calibration, Lines(lambda line: None), lambda line: None).fit()
    assert tried[-1] == 0.7
    assert found["stray_light.share"] == max(best, start)


def test_a_network_is_trained_and_scored_on_the_candidate(tmp_path, monkeypatch):
    quick = {"training": {"rounds": 1, "steps": 1}, "retrieval": {"iterations": 0, "ms_ssim": 0.0}}
    study = {
        "title": "small",
        "measure": "prediction",
        "protocol": {"metrics": ["psnr"]},
        "holograms": {"name": "wirtinger", "params": {"iterations": 2}},
        "training": {"dataset": "dead_leaves", "params": {"count": 2, "seed": 2}, "held_out": 1},
        "methods": [{"name": "hil", "params": {**quick, "network": {"name": "identity"}}}],
    }
    one = Targets("photographs", {"count": 1})
    calibration = replace(SMALL, targets=one, prediction=Prediction(25.0, "stray_light.share", 0.3, study))
    clear, hazy = (fitting(calibration).predicted({"stray_light.share": share}) for share in (0.0, 0.6))
    assert clear > hazy + 0.5
    (tmp_path / "mine.yaml").write_text("like: leto-mild\nname: leto-mild-b\n")
    monkeypatch.chdir(tmp_path)  # the file is named from here, and the study lies elsewhere
    own = replace(fitting(calibration), source="mine.yaml", profile=load_profile("mine.yaml"))
    assert own.predicted({"stray_light.share": 0.0}) != clear


def test_a_calibration_belongs_to_the_profile_of_its_name_and_to_others_of_its_kind(tmp_path):
    for name in ("leto-hazy-b", "mine"):
        (tmp_path / f"{name}.yaml").write_text(f"like: leto-hazy\nname: {name}\n")
    own = load_calibration(load_profile("leto-hazy"))
    assert load_calibration(load_profile("leto-hazy-b.yaml", tmp_path)) == own
    for other in (load_profile("mine.yaml", tmp_path), load_profile("leto-sled"), load_profile("ideal")):
        with pytest.raises(UserError, match=f"'{other.name}' is not fitted to anything"):
            load_calibration(other)


def test_a_display_without_published_figures_is_refused_in_one_line_that_says_what_is_right(tmp_path):
    (tmp_path / "wide.yaml").write_text("like: leto-hazy\nname: leto-hazy-wide\npanel: {pitch: 8.0e-6}\n")
    (tmp_path / "same.yaml").write_text(
        "name: leto-hazy\nversion: 1\nseed: 1\ndescription: ours\npanel: {shape: [128, 128], pitch: 6.4e-6, "
        "wavelengths: [5.2e-7], distance: 0.012, bits: 8}\n"
    )
    for file, said in (("wide", "panel.pitch is 8e-06, and"), ("same", "profile 'leto-hazy': panel.shape")):
        with one_line(said, "calibrate takes leto-aged or leto-hazy", "parametric_model"):
            calibrate(str(tmp_path / f"{file}.yaml"))


def test_figures_and_values_are_printed_beside_what_was_wanted(monkeypatch, capsys):
    monkeypatch.setattr(Fitting, "fit", lambda _: ({"stray_light.share": 0.512}, 25.04))
    monkeypatch.setattr(Fitting, "captured", lambda _, values: {"double_phase": 15.3, "wirtinger": 17.5})
    calibrate("leto-hazy")
    out = capsys.readouterr().out
    assert "double_phase   15.30 dB   wanted 15.24" in out
    assert "network        25.04 dB   wanted 25.10" in out
    assert "stray_light.share: 0.512" in out
