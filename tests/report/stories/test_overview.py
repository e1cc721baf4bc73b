"""The first page of a report, and how far its answer goes."""

from pathlib import Path
from typing import Any

import pytest

from holobench_eval.report import write_report
from holobench_eval.report.description import Description, Display
from holobench_eval.report.stories import overview
from holobench_eval.report.story import Report
from tests.support import synthetic_study as synthetic

TARGETS = synthetic.TARGETS[1:4]
DESCRIPTION = Description(
    displays=(
        Display(
            "leto-aged",
            "Version 1.",
            (),
            basis="simulated; x was fitted to published PSNR",
            modelled={"HIL": (2, 9), "GS": (0, 9)},
        ),
    )
)
EVIL = "Is HIL <script>alert(1)</script> | better | =cmd?\n\n# No heading"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("front")
    records = synthetic.study(folder, targets=TARGETS)
    facts = synthetic.facts(
        targets=TARGETS, question=EVIL, would_change="Another sign.", tuned={"HIL": "the rates were chosen elsewhere"}
    )
    return write_report(facts, records, folder, {}, DESCRIPTION)[0].read_text()


def test_a_report_is_question_answer_board_plot_pictures_and_limits(page: str) -> None:
    order = [
        "# Made-up captures",
        "Is HIL &lt;script>",
        "## Answer",
        "| A | Wirtinger |",
        "(figures/quality-paired-leto-aged.png)",
        "(figures/answer-pictures.jpg)",
        "## Limits",
        "## Reproduce",
        "[details.md](details.md)",
    ]
    places = [page.index(text) for text in order]
    assert places == sorted(places)
    assert len(page.splitlines()) <= 80
    assert "Is HIL &lt;script>alert(1)&lt;/script> \\| better \\| =cmd? # No heading" in page
    assert "<script" not in page


def test_the_limits_name_sample_holes_inverse_crime_display_and_tuning(page: str) -> None:
    for phrase in (
        "- **Sample:** 3 targets. Brackets: how a mean varies with other pictures of the kind",
        "- No difference can be shown: 3 targets that are independent are too few for a test, 6 are needed.",
        "1 planned cells have no score",
        "- **Inverse crime:** effects of a display that models have in its equations: HIL 2 of 9. Expect less.",
        "- **Displays:** leto-aged: simulated; x was fitted to published PSNR.",
        "- **Published:** Chakravarthula et al. 2020, Table 3.",
        "](details.md#limits)",
    ):
        assert phrase in page, phrase
    assert "GS for" not in page


def test_of_many_methods_the_best_of_each_group_the_question_and_the_baseline_are_shown() -> None:
    means = {f"m{number}": 20.0 - number for number in range(8)} | {"old": 5.0, "trained": 1.0}
    many = synthetic.results_of(means, question="Is m6 better?", trained=frozenset({"trained"}))
    assert overview.chosen(many, "bench") == ["trained", "m0", "m6", "old"]
    few = synthetic.results_of({"old": 17.0, "new": 16.0})
    assert overview.chosen(few, "bench") == ["old", "new"]


def limited(**changes: Any) -> str:
    records = [
        synthetic.record(label, synthetic.cell(label, target, "ideal"), {"psnr_linear": 20.0})
        for label in ("GS", "Wirtinger")
        for target in synthetic.TARGETS
    ]
    report = Report(synthetic.results(records, **changes), records, Path("none"), {}, Description())
    return "\n".join(overview.limits(report))


@pytest.mark.parametrize(("wanted", "missed"), [(None, True), (("psnr", "lpips_alex"), True), (("psnr",), False)])
def test_lpips_is_missed_only_where_it_was_wanted(wanted: tuple[str, ...] | None, missed: bool) -> None:
    assert ("**LPIPS:**" in limited(metrics=wanted)) == missed
