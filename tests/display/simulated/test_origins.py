"""What is said of where a profile's values come from belongs to that profile."""

from dataclasses import fields

import pytest

from holobench_eval.display import load_profile
from holobench_eval.display.simulated.origins import FITTED, families, fit_of, load_family, parameters, value_of


@pytest.mark.parametrize("name", sorted(path.stem for path in FITTED.glob("*.yaml")))
def test_a_fitted_profile_lies_within_the_ranges_of_its_fit(name):
    profile = load_profile(name)
    fit = fit_of(profile)
    for parameter, (low, high) in fit["free"].items():
        assert low < value_of(profile, parameter) < high


def test_a_fit_belongs_to_the_profile_of_its_name_and_to_others_of_its_kind_and_panel(tmp_path):
    (tmp_path / "wide.yaml").write_text("like: leto-hazy\nname: leto-hazy-wide\npanel: {pitch: 8.0e-6}\n")
    for name in ("leto-hazy-b", "mine"):
        (tmp_path / f"{name}.yaml").write_text(f"like: leto-hazy\nname: {name}\n")
    fit = fit_of(load_profile("leto-hazy"))
    assert fit["prediction"]["psnr"] == 25.1
    assert fit_of(load_profile("leto-hazy-b.yaml", tmp_path)) == fit
    for file in ("wide.yaml", "mine.yaml", "leto-sled", "ideal"):
        assert fit_of(load_profile(file, tmp_path)) is None


@pytest.mark.parametrize("name", families())
def test_every_range_is_of_a_parameter_of_the_base_and_says_its_source(name):
    family = load_family(name)
    for given in parameters(family):
        assert given["low"] < given["high"]
        assert given["source"]
        value_of(load_profile(family["base"]), given["name"])


def test_the_display_without_a_number_is_the_member_nearest_to_the_middle():
    named, member = load_profile("leto-2020"), load_profile("leto-2020-12")
    apart = {"name", "version", "description", "like", "digest"}
    assert {f.name for f in fields(named) if getattr(named, f.name) != getattr(member, f.name)} <= apart
    assert named.stray_light.share <= 0.3
