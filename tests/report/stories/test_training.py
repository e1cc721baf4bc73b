"""What a report tells of trainings and of what trained methods say of their displays, from files of strangers too."""

import json
import math
import re

import pytest

from holobench_eval.core.hashing import digest
from holobench_eval.display.estimates import estimate, joined
from holobench_eval.report import Description, Results, records_frame, write_report
from holobench_eval.report.charts.curves import MOST, draw_trainings
from holobench_eval.report.facts import TrainingSet
from holobench_eval.report.markdown import blocks
from holobench_eval.report.stories.overview import limits
from holobench_eval.report.stories.training import PARTS, Training, estimates, verdict
from holobench_eval.report.story import Report
from holobench_eval.study.artifacts import Round, TrainingRecord, rounds_of
from tests.support import synthetic_study as synthetic
from tests.support.reports import whole

TARGETS = synthetic.TARGETS[1:4]
PAIRS = (("GS", "leto-aged"), ("HIL", "leto-aged"), ("U-Net", "leto-aged"))
TRAINING = TrainingSet("dead_leaves (count = 24, seed = 0)", 24, 4, 200)
COLUMNS = "round,step,predicted_psnr,captured_psnr,fidelity_psnr,captures,seconds,l1,perceptual,adversarial,total,judge"
LOG = f"""{COLUMNS}
1,100,,,,12,30.1,0.09,0.2,0.7,2.1,0.6
1,600,20.5,12.7,14.7,16,120.2,,,,,
2,100,,,,20,130.1,0.08,0.2,0.7,2.0,0.6
2,300,21.25,15.5,18.125,24,200.2,,,,,
"""


def facts(**changes):
    given = {"targets": TARGETS, "pairs": PAIRS, "reported": {}, "baseline": "GS", "privileged": frozenset()}
    return synthetic.facts(**(given | {"trained": frozenset({"HIL", "U-Net"}), "training": TRAINING} | changes))


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
    return whole(write_report(facts(**changes), found, tmp_path, {}, Description())[0])


def report_of(found, folder, **changes):
    results = Results(records_frame(found, facts(**changes)), facts(**changes))
    return Report(results, found, folder, {}, Description())


def section_of(found, folder):
    """The text of the section alone, and the files of its figures."""
    part, report = PARTS[0], report_of(found, folder)
    return str(blocks(part.render(report, []))), [path for path, _ in part.figures(report)]


def test_captures_for_training_are_told_apart_from_those_while_solving(found):
    last = max(index for index, record in enumerate(found) if record["label"] == "HIL")
    lost = trained(found[last] | {"state": "failed", "reason": "x", "scores": {}}, "hil")
    frame = records_frame([*found[:last], lost, *found[last + 1 :]], facts())
    took = frame[frame["state"] == "done"].groupby("label")[["captures", "training_captures", "training_s"]]
    assert took.mean().loc["HIL"].tolist() == [50, 140, 3600.5]
    assert took.mean().loc["GS"].tolist() == [0, 0, 0]
    holes = frame[frame["state"] == "failed"]
    assert len(holes) == 2
    assert holes["training_captures"].isna().all()
    table = Results(frame, facts()).table
    assert table.set_index("label").loc["HIL", "learned_sha256"] == "hil" * 16


def test_a_training_that_is_not_beside_the_report_or_not_the_right_one_is_said(found, tmp_path):
    keep(tmp_path, "hil", sha256="another", perceptual="<img src=x onerror=alert(1)> | [l](javascript:1)")
    text, _ = section_of(found, tmp_path)
    assert "The figures for HIL here and its scores come from different trainings." in text
    assert "Nothing is known of the training of U-Net" in text
    assert "| U-Net | leto-aged | – | – | – | 20 | 4 | none | not trained |" in text
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
    assert "Training took place" in text
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


def test_a_learned_display_claims_no_camera(found, tmp_path):
    name = "hil trained on leto-aged"
    moved = [
        record | {"cell": record["cell"] | {"condition": name, "profile": name}}
        for record in found
        if record["label"] == "HIL"
    ]
    keep(tmp_path, "hil")
    learned = {"pairs": (("HIL", name),), "network": name, "trained": frozenset({"HIL"}), "baseline": None}
    text = written(moved, tmp_path, **learned)
    for phrase in ("refused.", "Stages of", "simulated benches"):
        assert phrase not in text.replace("a study in which one is a target is refused.", ""), phrase
    for phrase in (
        "| HIL and the display itself | leto-aged | 140 |",
        "none: there is no sensor",
        "none: the network predicts in the frame",
    ):
        assert phrase in text, phrase


def test_weights_that_a_method_of_the_question_learned_without_stand_among_the_limits(found, tmp_path):
    weights = {"VGG-19 weights": "absent", "LPIPS weights (AlexNet)": "0123"}
    described = description("hil") | {"external": weights}
    records = [
        record | {"cell": record["cell"] | {"prepared": [digest(described)]}} if record["label"] == "HIL" else record
        for record in found
    ]
    keep(tmp_path, "hil", description=described)
    keep(tmp_path, "unet")

    asked, other = (
        "\n".join(limits(report_of(records, tmp_path, question=question)))
        for question in ("Is HIL better than U-Net?", "Is U-Net better?")
    )
    assert "**Weights:** without VGG-19 weights, which this machine has not, learned HIL." in asked
    assert "**Weights:**" not in other


FOUND = [
    *(estimate("lut_exponent", colour, value) for colour, value in enumerate((1.27, 1.24, 1.21))),
    *(estimate("undiffracted_phase", colour, 3.1) for colour in range(3)),
    *(estimate("crosstalk", colour, 0.6) for colour in range(3)),
]
TRUTH = [
    *(estimate("lut_exponent", colour, value) for colour, value in enumerate((1.28, 1.25, 1.22))),
    *(estimate("undiffracted_phase", colour, -3.1) for colour in range(3)),
    *(estimate("crosstalk", colour, 0.45) for colour in range(2)),
]


def stated(**facts: object) -> Training:
    record = TrainingRecord({"description": {"profile": "leto-aged"}, **facts}, ())
    return Training("parametric", ("parametric",), "leto-aged", record)


def test_numbers_outside_their_stated_errors_are_named() -> None:
    rows = list(estimates(stated(estimates=joined(FOUND, TRUTH))))
    assert max(row["apart"] for row in rows if row["name"] == "undiffracted_phase") == pytest.approx(0.083, abs=1e-3)
    assert verdict(rows) == "6 of 8 numbers are within their stated errors; outside: crosstalk."


def test_estimates_that_are_all_right_are_said_to_be() -> None:
    right, unjudged = (estimates(stated(estimates=joined(*each))) for each in ((FOUND[:6], TRUTH), (FOUND, [])))
    assert verdict(list(right)) == "All 6 numbers are within their stated errors."
    assert verdict(list(unjudged)).startswith("None of these has a ground truth")


@pytest.mark.parametrize(
    "facts",
    [
        {},
        {"estimates": "many", "missing": "much"},
        {"estimates": [1, {"name": 2, "value": 1.0}, {"name": "x"}, {"name": "x", "value": 1, "colour": []}]},
        {"estimates": [{"name": "x", "value": math.nan, "colour": 0}, {"name": "x", "value": True}], "missing": [1]},
        {"estimates": [{"name": "x", "value": 10**400, "colour": 0}]},
    ],
)
def test_provenance_of_strangers_shows_nothing_and_stops_nothing(facts: dict[str, object]) -> None:
    for training in (stated(**facts), Training("x", ("x",), "y", None)):
        assert list(estimates(training)) == []
