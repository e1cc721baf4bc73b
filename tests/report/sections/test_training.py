"""The first page of a report, and what it tells of trainings."""

import json
import math
import re

import pytest

from holobench_eval.core.hashing import digest
from holobench_eval.report import Description, Results, records_frame, table_from_records, write_report
from holobench_eval.report.answers import kind_of
from holobench_eval.report.answers.limits import limits
from holobench_eval.report.charts.curves import MOST, draw_trainings
from holobench_eval.report.facts import TrainingSet
from holobench_eval.report.description import Display
from holobench_eval.report.markdown import blocks
from holobench_eval.report.section import Report
from holobench_eval.report.sections import overview
from holobench_eval.report.sections.training import SECTIONS
from holobench_eval.study.artifacts import Round, rounds_of
from tests.report.answers.test_answers import results_of
from tests.support import synthetic_study as synthetic
from tests.support.reports import whole

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


PAIRS = (("GS", "leto-aged"), ("HIL", "leto-aged"), ("U-Net", "leto-aged"))
TRAINING = TrainingSet("dead_leaves (count = 24, seed = 0)", 24, 4, 200)
COLUMNS = "round,step,predicted_psnr,captured_psnr,fidelity_psnr,captures,seconds,l1,perceptual,adversarial,total,judge"
LOG = f"""{COLUMNS}
1,100,,,,12,30.1,0.09,0.2,0.7,2.1,0.6
1,600,20.5,12.7,14.7,16,120.2,,,,,
2,100,,,,20,130.1,0.08,0.2,0.7,2.0,0.6
2,300,21.25,15.5,18.125,24,200.2,,,,,
"""


def layout(**changes):
    given = {"targets": TARGETS, "pairs": PAIRS, "reported": {}, "baseline": "GS", "privileged": frozenset()}
    return synthetic.layout(**(given | {"trained": frozenset({"HIL", "U-Net"}), "training": TRAINING} | changes))


def description(method):
    return {"method": method, "profile": "leto-aged", "params": {}}


def trained(record, method, **learned):
    """The record of a method that was trained."""
    cell = record["cell"] | {"method": method, "prepared": [digest(description(method))]}
    given = {"sha256": method * 16, "captures": 140, "seconds": 3600.5} | learned
    return record | {"cell": cell, "learned": given if record["state"] == "done" else None}


def keep(output, name, log=LOG, **facts):
    folder = output / "training"
    folder.mkdir(exist_ok=True)
    provenance = {"description": description(name), "sha256": name * 16, "captures": 140, "seconds": 3600.5, **facts}
    (folder / f"{name}.json").write_text(json.dumps(provenance))
    (folder / f"{name}.csv").write_text(log)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    records = []
    for record in synthetic.study(folder, size=32, targets=TARGETS):
        if record["label"] in ("HIL", "SGD") and record["cell"]["condition"] == "leto-aged":
            label, method = {"HIL": ("HIL", "hil"), "SGD": ("U-Net", "unet")}[record["label"]]
            records.append(trained(record | {"label": label}, method))
        elif record["label"] == "GS" and record["cell"]["condition"] == "leto-aged":
            records.append(record | {"learned": None})
        elif record["cell"]["condition"] == synthetic.REFERENCE:
            records.append(record)
    return records


def written(found, tmp_path, **changes):
    return whole(write_report(layout(**changes), found, tmp_path, {}, Description())[0])


def report_of(found, folder, **changes):
    results = Results(records_frame(found, layout(**changes)), layout(**changes))
    return Report(results, found, folder, {}, Description())


def section_of(found, folder):
    """The text of the section alone, and the files of its figures."""
    (section,), report = SECTIONS, report_of(found, folder)
    return str(blocks(section.render(report, []))), [path for path, _ in section.figures(report)]


def test_captures_for_training_are_told_apart_from_those_while_solving(found):
    last = max(index for index, record in enumerate(found) if record["label"] == "HIL")
    lost = trained(found[last] | {"state": "failed", "reason": "x", "scores": {}}, "hil")
    frame = records_frame([*found[:last], lost, *found[last + 1 :]], layout())
    took = frame[frame["state"] == "done"].groupby("label")[["captures", "training_captures", "training_s"]]
    assert took.mean().loc["HIL"].tolist() == [50, 140, 3600.5]
    assert took.mean().loc["GS"].tolist() == [0, 0, 0]
    holes = frame[frame["state"] == "failed"]
    assert len(holes) == 2
    assert holes["training_captures"].isna().all()
    table = table_from_records(frame, layout())
    assert table.set_index("label").loc["HIL", "learned_sha256"] == "hil" * 16


def test_a_study_without_training_has_neither_its_columns_nor_its_section(found, tmp_path):
    plain = [record for record in found if record["label"] not in ("HIL", "U-Net")]
    text = written(plain, tmp_path, trained=frozenset(), training=None, pairs=PAIRS[:1])
    assert "## Training" not in text
    assert "## Diagnosis" not in text
    for name in ("records.csv", "table.csv"):
        assert "training" not in (tmp_path / name).read_text().splitlines()[0]


def test_every_round_is_listed_with_its_figures_on_held_out_images(found, tmp_path):
    keep(tmp_path, "hil", perceptual="oriented filters")
    keep(tmp_path, "unet")
    text = written(found, tmp_path, note="Weights *as drawn*.\n\n# No heading | no table")
    assert "| HIL | leto-aged | 140 | 3600 | 20 | 4 | 2 | oriented filters | hilhilhilh |" in text
    assert "| HIL | 1 | 16 | 120 | 20.50 | 12.70 | 14.70 |" in text
    assert "| U-Net | 2 | 24 | 200 | 21.25 | 15.50 | 18.12 |" in text
    assert "(figures/training-1.png)" in text
    assert (tmp_path / "figures" / "training-1.png").is_file()
    assert "24 of dead_leaves (count = 24, seed = 0), of which 4 only watch the training; at most 200 captures" in text
    note = text.index("Weights \\*as drawn\\*. # No heading \\| no table")
    assert text.index("\n## Limits\n") < note


def test_a_training_that_is_not_beside_the_report_or_not_the_right_one_is_said(found, tmp_path):
    keep(tmp_path, "hil", sha256="another", perceptual="<img src=x onerror=alert(1)> | [l](javascript:1)")
    text, _ = section_of(found, tmp_path)
    assert "The figures for HIL here and its scores come from different trainings." in text
    assert "Nothing is known of the training of U-Net" in text
    assert "| U-Net | leto-aged | – | – | 20 | 4 | – | none | not trained |" in text
    assert "<img" not in text  # names of strangers stay text
    assert not re.search(r"(?<!\\)\]\(javascript", text)
    first = next(index for index, record in enumerate(found) if record["label"] == "HIL")
    mixed = [*found[:first], trained(found[first], "hil", sha256="other"), *found[first + 1 :]]
    assert "The scores of HIL come from 2 different trainings." in section_of(mixed, tmp_path)[0]


@pytest.mark.parametrize(
    "log",
    ["", "a,b\n1,2\n", "round,step\nx,y\n", "round\n1\n1,2,3,4\n", "\x00", "round,predicted_psnr\n1,nan\ninf,3\n"],
)
def test_logs_of_strangers_show_nothing_and_stop_nothing(found, tmp_path, log):
    keep(tmp_path, "hil", log=log)
    (tmp_path / "training" / "broken.json").write_text("{")
    (tmp_path / "training" / "list.json").write_text("[]")
    text, figures = section_of(found, tmp_path)
    assert "No figures on held-out images were logged." in text
    assert figures == []


def logged(folder, log):
    (folder / "training.csv").write_text(log)
    return rounds_of(folder / "training.csv")


def test_a_round_is_the_last_figure_of_every_kind(tmp_path):
    first, second = logged(tmp_path, LOG)
    assert first == Round(1, 16, 120.2, 20.5, 12.7, 14.7)
    assert second == Round(2, 24, 200.2, 21.25, 15.5, 18.125)
    assert rounds_of(tmp_path / "absent.csv") == ()
    (lone,) = logged(tmp_path, "round,captures\n3,7\n")
    assert (lone.captures, math.isnan(lone.fidelity)) == (7, True)


def test_few_trainings_have_a_panel_each_and_many_are_left_to_the_table(tmp_path):
    rounds = logged(tmp_path, LOG)
    few = draw_trainings(tmp_path / "few", [(f"m{index}", rounds) for index in range(7)])
    assert [path.name for path in few] == ["few-1.png", "few-2.png"]
    assert draw_trainings(tmp_path / "many", [(f"m{index}", rounds) for index in range(MOST + 1)]) == []
    assert draw_trainings(tmp_path / "none", [("m", ())]) == []


def test_a_prediction_study_never_speaks_of_picture_quality(found, tmp_path):
    records = [record for record in found if record["label"] != "GS"]
    holograms = "wirtinger (iterations = 200)"
    text = written(records, tmp_path, measure="prediction", holograms=holograms, pairs=PAIRS[1:], baseline="HIL")
    for phrase in (
        "HIL predicts best (",
        "It does not measure picture quality",
        "The patterns are holograms of the targets by wirtinger, the same for all methods.",
        "predictions of the captures of holograms by wirtinger (iterations = 200)",
    ):
        assert phrase in text, phrase
    assert "captures while solving" not in text


def test_a_learned_display_claims_no_camera(found, tmp_path):
    name = "hil trained on leto-aged"
    moved = [
        record | {"cell": record["cell"] | {"condition": name, "profile": name}}
        for record in found
        if record["label"] == "HIL"
    ]
    keep(tmp_path, "hil")
    learned = {"pairs": (("HIL", name),), "learned_display": name, "trained": frozenset({"HIL"}), "baseline": None}
    text = written(moved, tmp_path, **learned)
    for phrase in ("refused.", "Stages of", "simulated benches"):
        assert phrase not in text.replace("a study in which one is a target is refused.", ""), phrase
    for phrase in (
        "| HIL and the display itself | leto-aged | 140 |",
        "none: there is no sensor",
        "none: the network predicts in the frame",
    ):
        assert phrase in text, phrase


def test_two_reports_of_one_training_have_equal_bytes(found, tmp_path):
    reports = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        keep(tmp_path / name, "hil", made=name)
        text, figures = section_of(found, tmp_path / name)
        reports.append((text, [path.read_bytes() for path in figures]))
    assert reports[0] == reports[1]
    assert len(reports[0][1]) == 1


def test_weights_that_a_method_of_the_question_learned_without_stand_among_the_limits(found, tmp_path):
    weights = {"VGG-19 weights": "absent", "LPIPS weights (AlexNet)": "0123"}
    described = description("hil") | {"external": weights}
    records = [
        record | {"cell": record["cell"] | {"prepared": [digest(described)]}} if record["label"] == "HIL" else record
        for record in found
    ]
    keep(tmp_path, "hil", description=described)
    keep(tmp_path, "unet")

    def told(question):
        report = report_of(records, tmp_path, question=question)
        return "\n".join(limits(report, kind_of(report.results)))

    text = told("Is HIL better than U-Net?")
    assert "**Weights:** without VGG-19 weights, which this machine has not, learned HIL." in text
    assert "**Weights:**" not in told("Is U-Net better?")
