"""The first page of a report."""


import pytest

from holobench_eval.report import Description, write_report
from holobench_eval.report.description import Display
from holobench_eval.report.sections import overview
from tests.report.answers.test_answers import results_of
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
    layout = synthetic.layout(
        targets=TARGETS, question=EVIL, would_change="Another sign.", tuned={"HIL": "the rates were chosen elsewhere"}
    )
    return write_report(layout, records, folder, {}, DESCRIPTION)[0].read_text()


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
        "- **Sample:** 3 targets; brackets are of how a mean varies with other pictures of the kind",
        "With 3 clusters no p can be below 0.25: no difference can be shown.",
        "1 planned cells have no score",
        "- **Inverse crime:** effects modelled by the simulation's own equations: HIL for 2 of 9; expect less.",
        "- **leto-aged:** simulated; x was fitted to published PSNR.",
        "- **Published:** Chakravarthula et al. 2020, Table 3.",
        "- **Tuned:** of HIL, the rates were chosen elsewhere.",
    ):
        assert phrase in page, phrase
    assert "GS for" not in page


def test_of_many_methods_the_best_of_each_group_the_question_and_the_baseline_are_shown() -> None:
    means = {f"m{number}": 20.0 - number for number in range(8)} | {"old": 5.0, "trained": 1.0}
    found = results_of(means, question="Is m6 better?", trained=frozenset({"trained"}))
    assert overview.chosen(found, "bench") == ["trained", "m0", "m6", "old"]
    few = results_of({"old": 17.0, "new": 16.0})
    assert overview.chosen(few, "bench") == ["old", "new"]
