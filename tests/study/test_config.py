from pathlib import Path

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.core.parts import load_config
from holobench_eval.study.changes import Changes
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from tests.study.studies import assert_refused, exchanged, one_line
from tests.support import plugins

DATASETS = plugins.text("sets")

FULL = """\
title: "A study"
seed: 7
display:
  profiles: [ideal]
  panel: [128, 256]
  exposure: matched
targets: {dataset: "sets.py:Images", params: {count: 3}}
methods:
  - wirtinger
  - {name: gerchberg_saxton, label: "GS", params: {iterations: 12}, profiles: [ideal]}
repeats: 2
baseline: GS
headline: ssim_srgb
save: {captures: true}
reported: {source: "a paper", rows: {GS: {psnr: 17.6}}}
"""


def write(folder: Path, text: str) -> Path:
    (folder / "sets.py").write_text(DATASETS)
    path = folder / "study.yaml"
    path.write_text(text)
    return path


def test_a_complete_config_becomes_a_study(tmp_path):
    study = load_study(write(tmp_path, FULL))
    assert (study.title, study.seed, study.repeats, study.baseline) == ("A study", 7, 2, "GS")
    assert (study.display.panel, study.display.exposure) == ((128, 256), "matched")
    assert (study.labels, study.targets.params) == (("wirtinger", "GS"), {"count": 3})
    assert (study.save.captures, study.save.phases) == (True, False)
    assert (study.name, study.text) == ("study", FULL)


def test_a_grid_is_a_row_for_each_combination(tmp_path):
    grid = "{name: wirtinger, params: {loss: huber}, grid: {iterations: [10, 50], step: [0.5, 1e-3]}}"
    text = exchanged(
        FULL, ("- wirtinger", f"- {grid}"), ("baseline: GS", "baseline: wirtinger, iterations 50, step 0.5")
    )
    study = load_study(write(tmp_path, text))
    expected = [(10, 0.5), (10, 0.001), (50, 0.5), (50, 0.001)]
    assert study.labels == (*(f"wirtinger, iterations {n}, step {step}" for n, step in expected), "GS")
    params = [entry.params for entry in study.methods[:4]]
    assert [(each["iterations"], each["step"], each["loss"]) for each in params] == [(*p, "huber") for p in expected]
    one = load_study(tmp_path / "study.yaml", Changes(methods=("wirtinger, iterations 50, step 0.5",)))
    assert one.methods == (study.methods[2],)
    assert load_study(tmp_path / "study.yaml", Changes(methods=("wirtinger",))).labels == study.labels[:4]


def test_defaults_are_filled_in(tmp_path):
    text = "title: t\ndisplay: {profiles: [ideal]}\ntargets: {dataset: 'sets.py:Images'}\nmethods: [wirtinger]\n"
    study = load_study(write(tmp_path, text))
    assert (study.baseline, study.display.panel, study.reported) == ("wirtinger", None, None)
    assert (study.methods[0].profiles, study.methods[0].params["iterations"]) == (("ideal",), 200)


STRUCTURE = [
    ("seed: 7", "sede: 7", "2:1: unknown key 'sede' in the document; did you mean 'seed'?"),
    ("seed: 7", "seed: -1", "2:7: seed should be greater than or equal to 0, got -1"),
    ("seed: 7", "seed: .nan", "2:7: '.nan' is not a finite number"),
    ("seed: 7", "seed: yes", '2:7: seed should be a whole number, got "yes"'),
    ("seed: 7", "file: x", "2:1: unknown key 'file'"),
    ('title: "A study"\n', "", "1:1: missing key 'title'"),
    ("profiles: [ideal]\n", "profiles: []\n", "4:13: display.profiles"),
    ("profiles: [ideal]\n", "profiles: [idel]\n", "4:14: unknown profile 'idel'; did you mean 'ideal'?"),
    ("panel: [128, 256]", "panel: [32, 256]", "5:11: display.panel[0] should be greater than or equal to 64, got 32"),
    ("panel: [128, 256]", "panel: [128]", "5:10: display.panel has too few values"),
    ("  panel: [128, 256]", "\tpanel: [128, 256]", "5:1: a tab, which YAML does not take here; use spaces"),
    ("- wirtinger", "- {name: sgd, params: {privileged: true}}", "9:26: method 'sgd': 'privileged' is no parameter; "),
    ("exposure: matched", "exposure: bright", "6:13: display.exposure should be 'equal' or 'matched'"),
    ("sets.py:Images", "phtographs", "7:20: unknown dataset 'phtographs'; did you mean 'photographs'?"),
    ("- wirtinger", "- wirtinker", "9:5: unknown method 'wirtinker'; did you mean 'wirtinger'?"),
    ("- wirtinger", "- 3", "9:5: methods[0] should be a mapping"),
    ("iterations: 12", "itterations: 12", "10:52: method 'gerchberg_saxton' has no parameter 'itterations'"),
    ("iterations: 12", "iterations: 0", "10:64: method 'gerchberg_saxton': parameter 'iterations': input should be"),
    ("params: {iterations: 12}", "grid: {iterations: [1, 0]}", "10:62: method 'gerchberg_saxton': parameter"),
    ("params: {iterations: 12}", "grid: {iterations: []}", "10:62: methods[1].grid.iterations"),
    ("repeats: 2", "timing: serial", "11:9: timing should be 'shared' or 'alone', got \"serial\""),
    ("headline: ssim_srgb", "headline: ssim_sgrb", "13:11: unknown metric 'ssim_sgrb'; did you mean 'ssim_srgb'?"),
    ("captures: true", "captures: 1", "14:18: save.captures should be a valid boolean"),
    ("psnr: 17.6", "psnr: high", "15:49: reported.rows.GS.psnr should be a valid number"),
    ("repeats: 2", "protocol: {version: v1}", "11:21: protocol.version should be 'v2'"),
    ("repeats: 2", "protocol: {metrics: [psnr, sism]}", "11:28: unknown metric 'sism'; did you mean 'ssim'?"),
    ("repeats: 2", "parts: [a]", "11:8: parts should be a mapping of names to the keys that differ"),
]
BEYOND = [  # structure: mistakes about other values, files, images and optics, which the schema cannot find
    ("profiles: [ideal]\n", "profiles: [ideal, ideal]\n", "4:21: 'ideal' and 'ideal' are both named 'ideal'"),
    ("profiles: [ideal]\n", "profiles: [absent.yaml]\n", "4:14: profile 'absent.yaml': no such file"),
    ("panel: [128, 256]", "panel: [1920, 1080]", "4:14: 'ideal' has 1080 rows and 1920 columns; rows come first: "),
    ("panel: [128, 256]", "panel: [64, 64]", "5:10: 'ideal' scores a window of 52 x 52 pixels of this panel; "),
    ("sets.py:Images", "sets.py:Training", "7:20: dataset 'sets.py:Training' holds training images"),
    ("sets.py:Images", "gone.py:Images", "7:20: dataset 'gone.py:Images': no such file"),
    ("count: 3", "cuont: 3", "7:47: dataset 'sets.py:Images' has no parameter 'cuont'; did you mean 'count'?"),
    ("count: 3", "count: -3", "7:54: dataset 'sets.py:Images': parameter 'count'"),
    ("count: 3", "count: 0", "7:20: dataset 'sets.py:Images' has no images"),
    ("profiles: [ideal]}", "profiles: [idael]}", "10:80: 'idael' is not in display.profiles; did you mean 'ideal'?"),
    ("params: {iterations: 12}", "grid: {iterations: [3, 3]}", "10:49: two rows are named 'GS, iterations 3'; list"),
    ('label: "GS"', "grid: {iterations: [3]}", "10:37: 'iterations' stands in params, too; keep one of the two"),
    ('label: "GS"', 'label: "Wirtinger "', "10:37: methods[1] and methods[0] share the label 'Wirtinger ', but"),
    ('label: "GS"', "label: wirtinger", "10:37: methods[1] and methods[0] share the label 'wirtinger'"),
    ('label: "GS"', "label: floor_black", "10:37: label 'floor_black' should be"),
    ('label: "GS"', "label: floor", "10:37: label 'floor' should be"),
    ('label: "GS"', 'label: "a\\nb"', "10:37: label 'a\\nb' should be printable"),
    ("baseline: GS", "baseline: gs", "12:11: no method has the label 'gs'; "),
    ("GS: {psnr", "gS: {psnr", "15:38: no method has the label 'gS'"),
    ("rows: {GS", "beside: idael, rows: {GS", "15:39: 'idael' is not in display.profiles; did you mean 'ideal'?"),
    ("repeats: 2", "protocol: {lpips_weights: no.pth}", "11:27: LPIPS weights: no such file or folder"),
    ("headline: ssim_srgb", "headline: ms_ssim_linear", "13:11: 'ideal' scores 104 x 208 pixels; ms_ssim needs 161"),
    ("repeats: 2", "parts: {a: {sede: 3}}", "11:13: unknown key 'sede' in the document; did you mean 'seed'?"),
    ("repeats: 2", "parts: {a: {seed: -3}}", "11:19: seed should be greater than or equal to 0, got -3"),
    ("repeats: 2", "parts: {a: {title: null}}", "11:20: missing key 'title'"),
    ("repeats: 2", "protocol: {metrics: [psnr]}", "11:21: the headline is 'ssim_srgb'; add ssim to the metrics, or "),
]


@pytest.mark.parametrize(("old", "new", "message"), STRUCTURE + BEYOND)
def test_a_mistake_is_one_line_at_its_place(tmp_path, old, new, message):
    assert old in FULL
    assert_refused(write(tmp_path, FULL.replace(old, new, 1)), message)


def test_one_method_twice_with_the_same_parameters_is_refused(tmp_path):
    text = FULL.replace("- wirtinger", "- {name: gerchberg_saxton, params: {iterations: 12}}")
    assert_refused(write(tmp_path, text), "10:5: methods[1] has the method, parameters and display")


def test_a_part_is_the_study_that_it_would_be_as_a_config_of_its_own(tmp_path):
    parts = "parts:\n  other: {seed: 8, methods: [sgd], baseline: null, reported: null}\n"
    text = exchanged(FULL, ('{dataset: "sets.py:Images", params: {count: 3}}', "{dataset: charts}"))
    first, alone = load_study(write(tmp_path, text + parts)), load_study(write(tmp_path, text))
    assert plan(first).cells == plan(alone).cells
    study = load_study(write(tmp_path, text + parts) / "other")
    assert (study.name, study.config, study.folder) == ("study/other", tmp_path / "study.yaml" / "other", tmp_path)
    (tmp_path / "own.yaml").write_text(study.text)
    own = load_study(tmp_path / "own.yaml")
    assert (own.seed, own.labels, own.baseline, own.reported) == (8, ("sgd",), "sgd", None)
    assert plan(study).cells == plan(own).cells != plan(first).cells


def test_a_fault_in_what_a_part_has_of_the_first_study_is_told_at_its_place_there(tmp_path):
    config = write(tmp_path, f"{FULL}parts:\n  other: {{methods: [sgd]}}\n")
    with one_line(at=f"{config}:12:11: no method has the label 'GS'"):
        load_study(config / "other")


def test_a_missing_config_is_named(tmp_path):
    with pytest.raises(UserError, match=r"absent\.yaml: no such file"):
        load_study(tmp_path / "absent.yaml")


def test_every_config_of_the_repository_asks_its_question_and_says_what_would_change_the_answer():
    for path in sorted((Path(__file__).parents[2] / "configs").glob("*.yaml")):
        parts = load_config(path).data.get("parts", {})
        for config in (path, *(path / part for part in parts)):
            if path.stem not in ("hil-paper", "peers", "photographs"):  # these need what is not here
                assert "?" in load_study(config).question, config
            own = parts[config.name] if config != path else load_config(path).data
            assert own.keys() > {"question", "would_change"}, config


@pytest.mark.parametrize(("panel", "enough"), [("[64, 64]", (118, 118)), ("[64, 256]", (118, 256))])
def test_a_panel_that_is_too_small_gets_the_smallest_one(tmp_path, panel, enough):
    with pytest.raises(UserError, match=rf"at least 96, which a panel of \[{enough[0]}, {enough[1]}\] has$"):
        load_study(write(tmp_path, FULL.replace("[128, 256]", panel)))
    assert load_study(write(tmp_path, FULL.replace("[128, 256]", str(list(enough))))).display.panel == enough
    with pytest.raises(UserError, match="registration needs at least 96"):
        load_study(write(tmp_path, FULL.replace("[128, 256]", str([enough[0] - 1, enough[1]]))))


def test_a_parameter_of_ones_own_method_may_not_say_what_only_its_class_declares(tmp_path):
    (tmp_path / "mine.py").write_text(
        "from dataclasses import dataclass\n\n@dataclass(frozen=True)\nclass Mine:\n    privileged: bool = False\n\n"
        "    def solve(self, target, bench):\n        return target\n"
    )
    text = FULL.replace("- wirtinger", '- {name: "mine.py:Mine", params: {privileged: true}}') + "isolation: none\n"
    assert_refused(write(tmp_path, text), "9:37: method 'mine.py:Mine': 'privileged' is no parameter; only")
