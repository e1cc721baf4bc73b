"""A family of displays: its draws, what figures leave of them, and the displays that are kept."""

import re
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.display import load_profile
from holobench_eval.display.simulated import profile as profiles
from holobench_eval.report.family import write_family
from holobench_eval.study.calibration import family as families
from holobench_eval.study.calibration import posterior
from holobench_eval.study.calibration.family import compute, drawn, load_family, missed, profile_of, rows_of
from holobench_eval.study.definition import Targets
from holobench_eval.study.executors import Serial

DRAWS = 6
UNTOLD: dict[str, Any] = {"digest": "", "like": None, "description": ""}  # of a profile, by a draw


@pytest.fixture(scope="module")
def small():
    """On a small panel, with figures that half of its draws have."""
    family = load_family("leto-2020")
    return replace(
        family,
        geometries=family.geometries[:1],
        panel=(128, 128),
        targets=Targets("dead_leaves", {"count": 1, "seed": 1, "colours": "natural"}),
        tolerance={"psnr": 4.0, "ssim": 0.5},
        members=2,
        outside=replace(family.outside, share=0.5),
    )


@pytest.fixture(scope="module")
def rows(small, tmp_path_factory):
    folder = tmp_path_factory.mktemp("family")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(families, "load_family", lambda _: small)
        compute("leto-2020", folder, Serial(), DRAWS - 2, lambda *_: None)
        text = (folder / "draws.csv").read_text()
        (folder / "draws.csv").write_text(text + "9,1,")  # killed as it wrote
        return folder, compute("leto-2020", folder, Serial(), DRAWS, lambda *_: None)


@pytest.mark.parametrize("name", families.names())
def test_every_draw_of_a_family_is_a_profile_within_its_ranges(name):
    family = load_family(name)
    seen = [drawn(family, index) for index in range(200)]
    assert {draw.geometry for draw in seen} == set(range(len(family.geometries)))
    assert np.mean([draw.is_outside for draw in seen]) == pytest.approx(family.outside.share, abs=0.1)
    for draw in seen[:20]:
        effects = {effect.name for effect in profile_of(family, draw, "one").effects()}
        assert {"uneven_table", "ripple"} <= effects or not draw.is_outside
        for given in family.parameters:
            assert given.low <= draw.values[given.name] <= given.high
    assert drawn(family, 7) == drawn(family, 7)


def test_the_displays_that_ship_are_draws_of_their_family_and_none_is_a_fog():
    family, outside = load_family("leto-2020"), list[bool]()
    for name in profiles.names(family=True):
        profile = load_profile(name)
        number = int(re.findall(r"Draw (\d+) of", (profiles.FAMILY / f"{name}.yaml").read_text())[0])
        draw = drawn(family, number)
        assert replace(profile, **UNTOLD) == replace(profile_of(family, draw, name), **UNTOLD)
        assert profile.stray_light.share <= 0.3
        outside.append(draw.is_outside)
    assert (len(outside), sum(outside)) == (family.members, round(family.members * family.outside.share))


def test_a_parameter_that_a_profile_lacks_is_refused(small):
    with pytest.raises(UserError, match="no parameter 'haze'"):
        profile_of(small, replace(drawn(small, 0), values={"stray_light.haze": 1.0}), "one")


def test_draws_are_resumed_and_a_line_that_was_cut_short_is_drawn_again(rows):
    folder, found = rows
    assert [row["draw"] for row in found] == list(range(DRAWS))
    np.testing.assert_equal(rows_of(folder / "draws.csv", list(found[0])), found)


def test_what_is_kept_fits_and_its_file_is_the_display(small, rows, tmp_path):
    folder, found = rows
    with pytest.raises(UserError, match="give more --draws"):
        posterior.members(replace(small, members=40), "leto-2020", found, folder)
    kept = posterior.members(small, "leto-2020", found, folder)
    assert missed(small, {**found[0], "wirtinger.psnr_linear": float("nan")}, "linear") == float("inf")
    assert [member.draw.is_outside for member in kept].count(True) == 1
    for member in kept:
        assert missed(small, member.scores, "linear") <= 1
        path = tmp_path / f"{member.profile.name}.yaml"
        posterior.write_member(path, small, member, DRAWS)
        loaded = load_profile(str(path))
        assert replace(loaded, **UNTOLD) == replace(member.profile, **UNTOLD)
    report = write_family(tmp_path, small, found, kept, posterior.middle(small, found, kept)).read_text()
    assert "leto-2020-02" in report
    assert (tmp_path / "corner.png").stat().st_size > 10_000


@pytest.mark.parametrize("line", ["1,2\n", "3,a\n", "1," * 60 + "\n"])
def test_a_damaged_line_of_draws_is_said(rows, tmp_path, line):
    (tmp_path / "draws.csv").write_text((rows[0] / "draws.csv").read_text() + line)
    with pytest.raises(UserError, match=r"draws.csv:8: damaged"):
        rows_of(tmp_path / "draws.csv", list(rows[1][0]))


def test_draws_of_other_code_are_not_resumed(small, rows, monkeypatch):
    monkeypatch.setattr(families, "load_family", lambda _: small)
    monkeypatch.setattr(families, "HARNESS", "another")
    with pytest.raises(UserError, match="by other code"):
        compute("leto-2020", rows[0], Serial(), DRAWS, lambda *_: None)


def test_the_committed_report_follows_from_its_draws_and_the_displays_that_ship(tmp_path):
    """What was scored of a display stands in the head of its file."""
    family, folder = load_family("leto-2020"), Path(__file__).parents[3] / "reports/family/posterior"
    drawn_rows = rows_of(folder / "draws.csv", families.columns_of(family))
    kept = []
    for name in profiles.names(family=True):
        head = (profiles.FAMILY / f"{name}.yaml").read_text()
        number, *scores = map(float, re.findall(r"(?:Draw |double_phase |wirtinger |SSIM )([0-9.]+)(?= |,|\.\n)", head))
        names = [f"{method}.{metric}_linear" for method in family.figures for metric in ("psnr", "ssim")]
        draw = drawn(family, int(number))
        kept.append(posterior.Member(draw, load_profile(name), dict(zip(names, scores, strict=True))))
    nearest = posterior.middle(family, drawn_rows, kept)
    assert write_family(tmp_path, family, drawn_rows, kept, nearest).read_text() == (folder / "report.md").read_text()


def test_the_display_without_a_number_is_the_member_nearest_to_the_middle():
    named, member = load_profile("leto-2020"), load_profile("leto-2020-12")
    apart = {"name", "version", "description", "like", "digest"}
    assert {f.name for f in fields(named) if getattr(named, f.name) != getattr(member, f.name)} <= apart
    assert named.stray_light.share <= 0.3
