"""The first page: what stands on it, in which order, and how far the answer goes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from holobench_eval.report import Description, write_report
from holobench_eval.report.data.categories import OFFLINE
from holobench_eval.report.description import Display
from holobench_eval.report.sections.front import overview
from tests.support import synthetic_study as synthetic

TARGETS = synthetic.TARGETS[1:4]
DESCRIPTION = Description(
    displays=(
        Display(
            "leto-aged",
            "Version 1.",
            (),
            basis="simulated; x was fitted to published PSNR",
            modelled={"HIL": ("crosstalk", "zero_order"), "GS": ()},
            effects=9,
        ),
    )
)
EVIL = "Is HIL <script>alert(1)</script> | better | =cmd?\n\n# No heading"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("front")
    records = synthetic.study(folder, targets=TARGETS)
    layout = synthetic.layout(
        targets=TARGETS,
        question=EVIL,
        would_change="Another sign.",
        about={"HIL": "A learned method.", "GD": "Not spoken of."},
        tuned={"HIL": "the rates were chosen elsewhere"},
    )
    return write_report(layout, records, folder, {}, DESCRIPTION)[0].read_text()


def test_a_report_begins_with_question_answer_limits_table_plot_and_pictures(page: str) -> None:
    order = [
        "## Question",
        "**What would change the answer.** Another sign.",
        "## Answer",
        "### Limits",
        "## What the answer rests on",
        "(figures/quality-paired-leto-aged.png)",
        "(figures/answer-pictures.jpg)",
        "## What was measured",
        "## Reproduce",
        "[details.md](details.md)",
    ]
    places = [page.index(text) for text in order]
    assert places == sorted(places)


def test_the_question_is_text_whatever_it_holds(page: str) -> None:
    assert "Is HIL &lt;script>alert(1)&lt;/script> \\| better \\| =cmd? # No heading" in page
    assert "<script" not in page


def test_names_are_explained_where_the_answer_has_them(page: str) -> None:
    assert "- **HIL**: A learned method." in page
    assert "Not spoken of" not in page


def test_the_limits_name_sample_holes_display_inverse_crime_tuning_and_oracle(page: str) -> None:
    limits = page.partition("### Limits")[2].partition("\n## ")[0]
    for phrase in (
        "- **Sample.** 3 targets, of the dataset photographs; brackets hold 95 % intervals",
        "With 3 clusters no p can be below 0.25: no difference can be shown.",
        "1 planned cells have no score",
        "- **Display leto-aged.** Simulated; x was fitted to published PSNR.",
        "- **Inverse crime on leto-aged.** The model of HIL has the bench's own form for 2 of its 9 effects (cross",
        "- **Tuned.** Of HIL, the rates were chosen elsewhere.",
        "- **Oracle.** The method Oracle may differentiate through the simulated bench",
    ):
        assert phrase in limits, phrase
    assert "GS has" not in limits


def test_the_first_page_leaves_lists_to_the_details(page: str) -> None:
    assert len(page.splitlines()) <= 200
    for heading in ("Every target", "Paired tests", "Holes", "Results", "Config and environment"):
        assert not re.search(rf"^## {heading}$", page, flags=re.MULTILINE), heading


def test_where_the_baseline_is_best_the_next_method_is_shown_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def ranking(_: str, categories: Sequence[str] = OFFLINE) -> list[str]:
        return ["wirtinger", "mine", "another"] if categories == OFFLINE else []

    monkeypatch.setattr(overview, "subjects", lambda _: [])
    results: Any = SimpleNamespace(
        layout=SimpleNamespace(baseline="wirtinger"),
        ranking=ranking,
        methods=lambda _: ranking(""),
        oracle=lambda _: "",
    )
    assert overview.chosen(results, "ideal") == ["wirtinger", "mine"]
