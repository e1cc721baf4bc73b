"""A part or a variant of a study: what the command line changes, where faults are told, and what its report says."""

import json
import re
from pathlib import Path

import pytest

from holobench_eval.commands import run as command
from holobench_eval.commands.options import changes_of, output_folder
from holobench_eval.commands.reports.check import problems_in
from holobench_eval.commands.reports.report import report
from holobench_eval.core.errors import UserError
from holobench_eval.core.yaml_source import parse
from holobench_eval.study.changes import Changes, changed, noted, recorded
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from tests.study.studies import planned
from tests.study.test_config import FULL, write
from tests.support.studies.fake_study import write_config

TOYS = ("plugins.py:Toy", '{name: "plugins.py:Toy", label: "toy, bright", params: {value: 2.0}}', "plugins.py:Seeing")


def test_methods_are_chosen_by_label_or_name_in_the_order_of_the_config(tmp_path):
    config = write_config(tmp_path, TOYS)

    def labels(*methods: str) -> tuple[str, ...]:
        return load_study(config, Changes(methods=methods)).labels

    assert labels("Seeing, Toy") == ("Toy", "Seeing")
    assert labels("toy, bright") == ("toy, bright",)
    assert labels("Toy") == ("Toy",)
    assert labels("plugins.py:Toy") == ("Toy", "toy, bright")
    assert labels("toy, bright", "Seeing") == ("toy, bright", "Seeing")


def test_what_a_config_says_of_methods_that_are_left_out_goes_with_them(tmp_path):
    path = write(tmp_path, FULL)
    study = load_study(path, Changes(methods=("wirtinger",)))
    assert (study.baseline, study.reported.rows) == ("wirtinger", {})
    assert load_study(path, Changes(methods=("GS",))).baseline == "GS"


def test_targets_are_chosen_by_name_or_number_and_their_cells_are_those_of_the_whole_study(tmp_path):
    config = write_config(tmp_path)
    whole = {cell.id for cell in planned(config).cells}
    for changes, items in (
        (Changes(targets=("gray 2,gray 0",)), ("gray 0", "gray 2")),
        (Changes(limit=2), ("gray 0", "gray 1")),
        (Changes(targets=("gray 1", "gray 2"), limit=1), ("gray 1",)),
        (Changes(limit=99), ("gray 0", "gray 1", "gray 2")),
    ):
        study = load_study(config, changes)
        cells = [cell for cell in plan(study).cells if not cell.method.startswith("floor")]
        assert study.items == tuple(cell.target for cell in cells) == items
        assert {cell.id for cell in cells} <= whole


def test_a_value_replaces_that_of_the_config_and_its_defaults(tmp_path):
    values = ("seed=9", "display.panel=[192, 192]", "methods.1.params.iterations=5", "save.phases=true", "note=a = b")
    study = load_study(write(tmp_path, FULL), Changes(values=(*values, "methods.0.params.step=0.5")))
    assert (study.seed, study.display.panel, study.methods[1].params["iterations"]) == (9, (192, 192), 5)
    assert study.save.phases
    assert study.methods[0].params["step"] == 0.5
    assert study.note.endswith(" a = b")


def test_a_parameter_is_set_by_the_label_of_a_table_or_else_the_name_of_methods(tmp_path):
    others = ("{name: seed, label: methods}", '{name: "mine.py:f.g", label: "a, b"}', "{name: hio, label: X}")
    document = parse("", f"title: T\nmethods: [wirtinger, {', '.join(others)}, {{name: hio, label: X.Y}}]\n")
    for key, rows in {"wirtinger": [0], "a, b": [2], "mine.py:f.g": [2], "X": [3], "X.Y": [4], "hio": [3, 4]}.items():
        data = changed(document, Changes(values=(f"{key}.n=5",)), {"methods"}).data["methods"]
        assert [row for row, each in enumerate(data) if isinstance(each, dict) and each.get("params")] == rows, key
    assert changed(document, Changes(values=("methods.0.name=sgd",)), {"methods"}).data["methods"][0]["name"] == "sgd"
    study = load_study(write(tmp_path, FULL), Changes(values=("GS.iterations=5", "wirtinger.step=0.5")))
    assert (study.methods[1].params["iterations"], study.methods[0].params["step"]) == (5, 0.5)


def test_methods_may_be_set_as_a_config_writes_them_and_then_chosen(tmp_path):
    path = write(tmp_path, FULL.replace("baseline: GS\n", "").replace("GS: {psnr", "wirtinger: {psnr"))
    values = ("methods=[wirtinger, sgd, {name: hio, label: HIO}]",)
    assert load_study(path, Changes(values=values)).labels == ("wirtinger", "sgd", "HIO")
    assert load_study(path, Changes(("HIO,wirtinger",), values=values)).labels == ("wirtinger", "HIO")


FAULTS = [
    (Changes(values=("seed=-1",)), "--set seed=-1: seed should be greater than or equal to 0, got -1"),
    (Changes(values=("saves.phases=true",)), "--set saves.phases=true: no method 'saves' among wirtinger, GS, and no"),
    (Changes(values=("GS.iterations=0",)), "--set GS.iterations=0: method 'gerchberg_saxton': parameter 'iterations'"),
    (Changes(values=("methods=1", "GS.iterations=2")), "--set GS.iterations=2: no method 'GS' among "),
    (Changes(values=("methods.1.params.iterations=0",)), "--set methods.1.params.iterations=0: method 'gerchberg_sax"),
    (Changes(values=("display.profiles.0=idael",)), "--set display.profiles.0=idael: unknown profile 'idael'; did"),
    (Changes(values=("display={profiles: [idael]}",)), "--set display={profiles: [idael]}: unknown profile 'idael'"),
    (Changes(values=("methods.7.label=x",)), "--set methods.7.label=x: 'methods' is a list; give a number from 0 to 1"),
    (Changes(values=("seed.x=1",)), "--set seed.x=1: 'seed' is a single value and has no 'x'"),
    (Changes(values=("seed",)), "--set seed: expected key=value, with dots"),
    (Changes(values=("seed=[",)), "--set seed=[: "),
    (Changes(values=("seed=1\nrepeats: 3",)), "--set seed=1"),
    (Changes(methods=("wirtinker",)), "--methods wirtinker: no such method in the config; did you mean 'wirtinger'?"),
    (Changes(targets=("image 9",)), "--targets image 9: no such target in the dataset; did you mean 'image "),
]


@pytest.mark.parametrize(("changes", "message"), FAULTS)
def test_a_fault_is_told_at_its_option(tmp_path, changes, message):
    with pytest.raises(UserError, match=f"^{re.escape(message)}"):
        load_study(write(tmp_path, FULL), changes)


def test_a_fault_of_the_config_keeps_its_line_when_methods_before_it_are_left_out(tmp_path):
    path = write(tmp_path, FULL.replace("iterations: 12", "iterations: 0"))
    with pytest.raises(UserError, match=r"study\.yaml:10:64: method 'gerchberg_saxton': parameter 'iterations'"):
        load_study(path, Changes(methods=("GS",)))
    assert load_study(path, Changes(methods=("wirtinger",))).labels == ("wirtinger",)


def test_changes_are_read_back_as_they_were_noted():
    changes = Changes(("a, b",), (), 3, ("seed=1",))
    assert recorded(json.loads(json.dumps(noted(changes)))) == changes
    assert str(changes) == "--methods 'a, b' --limit 3 --set seed=1"
    assert noted(Changes()) == {}
    assert recorded({}) == Changes()
    with pytest.raises(UserError, match="unknown key 'more'"):
        recorded({"changes": {"more": 1}})


@pytest.mark.slow
@pytest.mark.usefixtures("no_physics")
def test_a_changed_study_says_so_and_leaves_the_whole_one_alone(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    config, whole, changed = (
        write_config(tmp_path),
        Path("holoeval-results/study"),
        Path("holoeval-results/study-changed"),
    )
    command.run(config, executor="serial", threads=1)
    before = (whole / "records.csv").read_bytes()
    command.run(config, executor="serial", threads=1, limit=2, values=["seed=4"])
    assert (whole / "records.csv").read_bytes() == before
    text = (changed / "report.md").read_text()
    assert text.startswith("# Fake (changed: --limit 2 --set seed=4)")
    assert "not the whole study of the config, and not its result: it was run with --limit 2 --set seed=4." in text
    assert "\nholoeval run study.yaml --limit 2 --set seed=4\n" in text
    assert problems_in(whole.parent)[1] == []

    (changed / "report.md").unlink()
    report(config, changed)
    assert (changed / "report.md").read_text() == text
    with pytest.raises(UserError, match="holoeval-results/study: holds the report of a whole study"):
        output_folder(load_study(config, changes_of(None, None, 2, None)), whole)
