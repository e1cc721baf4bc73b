"""Focal stacks and light fields from made-up records whose answer is known."""

from typing import Any

import pandas as pd

from holobench_eval.report import Results
from holobench_eval.report.charts.tiles import noted
from holobench_eval.report.scores import parse
from holobench_eval.report.stories import answer, story_of
from holobench_eval.report.stories import focus as story
from holobench_eval.report.stories.focus import by_plane
from tests.support import synthetic_study as synthetic

PLANES = {
    f"{scene}@{plane:g}mm": (scene, plane) for scene in ("shapes", "motorcycle", "room") for plane in (-2.0, 0.0, 2.0)
}
SECONDS = {"lens": 2.0, "joint": 5.0, "quick": 0.1}


def results_of(quality: dict[str, float], noise: float = 0.2, **changes: Any) -> Results:
    """A study in which every method has a mean quality, less at the outer planes for the joint hologram."""
    records = []
    for label, mean in quality.items():
        for index, (target, (_, plane)) in enumerate(PLANES.items()):
            value = mean - (abs(plane) if label == "joint" else 0.0) + noise * (index % 3)
            scores = {"psnr_linear": value + 1, "psnr_linear_blur1": value + 2}
            scores |= {"psnr_linear_infocus": value, "ssim_linear_infocus": 0.5}
            described = synthetic.cell(label, target, "bench", measure="focus")
            records.append(synthetic.record(label, described, scores, seconds=99.0, cpu_s=SECONDS[label]))
    given = {"headline": "psnr_linear_infocus", "baseline": "lens", "measure": "focus", "planes": PLANES}
    return synthetic.results(records, **(given | {"stacked": frozenset({"joint"})} | changes))


def lines(text: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines()]


def test_a_table_has_a_column_a_plane_and_the_processor_seconds_of_a_hologram_and_of_a_scene() -> None:
    header, _, lens, joint = lines(by_plane(results_of({"lens": 20.0, "joint": 19.0}, noise=0.0), "bench"))
    assert header[2:] == ["-2 mm", "0 mm", "2 mm", "all planes", "processor seconds a hologram", story.SECONDS]
    assert lens[:2] + lens[5:] == ["lens", "one plane", "20.00", "2", "6"]
    assert joint[1] == "all planes"
    assert [cell[:5] for cell in joint[2:6]] == ["17.00", "19.00", "17.00", "17.67"]
    assert joint[6:] == ["5", "5"]


def test_views_have_a_column_a_place_and_one_hologram_a_scene() -> None:
    results = results_of({"lens": 20.0, "joint": 19.0}, noise=0.0, measure="views")
    header, _, lens, joint = lines(by_plane(results, "bench"))
    assert header[2:] == ["-2", "0", "2", "all places", "processor seconds a hologram", story.SECONDS]
    assert [lens[1], *lens[6:]] == ["the middle view", "2", "2"]
    assert [joint[1], *joint[6:]] == ["all views", "5", "5"]


def test_scores_in_focus_are_named_so_and_lead_the_tables_which_other_studies_lack() -> None:
    assert story_of(results_of({"lens": 20.0})) is story
    assert story_of(results_of({"lens": 20.0}, measure="picture")) is not story
    assert parse("psnr_linear_infocus").axis == "PSNR in focus, linear light [dB]"
    leading = [score.key for score in results_of({"lens": 20.0}).leading]
    assert leading[:3] == ["psnr_linear_infocus", "ssim_linear_infocus", "psnr_linear"]
    scores = [parse(key) for key in leading[:2]]
    cell = pd.Series({score.column: value for score, value in zip(scores, (16.384, 0.4), strict=True)})
    assert noted(scores, cell) == "in focus: PSNR 16.38 dB   SSIM 0.400"


def test_one_hologram_of_all_planes_is_compared_with_one_a_plane() -> None:
    results = results_of({"lens": 20.0, "joint": 18.0})
    assert answer(results) == ["joint loses to lens, -3.33 dB [-4.10, -2.56]."]
    assert answer(results_of({"joint": 18.0}, baseline=None)) == ["joint 16.87 dB."]
