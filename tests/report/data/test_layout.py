import re
from dataclasses import replace

import pytest

from holobench_eval.report import layout_of
from holobench_eval.report.description import describe
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from tests.support.studies.fake_study import PLUGINS

CONFIG = """
title: Two methods
seed: 7
display: {profiles: [ideal, leto-aged], panel: [128, 128]}
targets: {dataset: "plugins.py:Gray", params: {count: 11}}
methods:
  - {name: "plugins.py:Toy", label: honest}
  - {name: "plugins.py:Following", label: knowing, profiles: [leto-aged]}
  - {name: "plugins.py:Seeing", label: seeing, profiles: [ideal], captures: 12, params: {value: 0.25}}
headline: ssim_linear
isolation: none
reported: {source: "a paper, table 3", rows: {honest: {psnr: 17.6}}}
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    (folder / "plugins.py").write_text(PLUGINS)
    (folder / "study.yaml").write_text(CONFIG)
    return load_study(folder / "study.yaml")


@pytest.fixture(scope="module")
def layout(study):
    return layout_of(study)


def test_a_layout_holds_what_the_config_orders(layout):
    assert layout.pairs == (("honest", "ideal"), ("honest", "leto-aged"), ("knowing", "leto-aged"), ("seeing", "ideal"))
    assert layout.targets == tuple(f"gray {number}" for number in range(11))  # and not by the alphabet
    assert (layout.title, layout.seed, layout.baseline, layout.headline) == ("Two methods", 7, "honest", "ssim_linear")
    assert layout.privileged == {"knowing"}
    assert layout.camera == {"seeing"}
    assert [layout.category(label) for label in layout.methods] == ["open loop", "oracle", "online"]
    assert (layout.reported_metrics, layout.reported_source) == (("psnr",), "a paper, table 3")


def test_a_layout_knows_how_every_cell_of_the_plan_is_made(study, layout):
    cells = [(label, cell) for label, cell in plan(study).labelled() if label in layout.methods]
    assert len(cells) == 44
    for label, cell in cells:
        assert layout.params[label] == cell.params
        assert layout.capture_limits.get(label) == cell.captures
        assert layout.panels[cell.profile] == cell.panel
        assert layout.seed == cell.seed
    assert layout.params["seeing"] == {"value": 0.25, "pause": 0.0, "fail": ""}
    assert (layout.study, layout.capture_limits) == ("study", {"seeing": 12})


def test_clusters_are_those_of_the_dataset_and_rows_whose_network_is_the_ideal_image_are_known(tmp_path, layout):
    assert (layout.clusters, layout.identities) == ({}, set())
    (tmp_path / "plugins.py").write_text(PLUGINS)
    crops = "targets: {dataset: crops, params: {names: [astronaut], each: 2, renderings: 1}}"
    network = '{name: hil, label: "%s", params: {network: {name: %s}}}'
    methods = f"  - {network % ('none', 'identity')}\n  - {network % ('some', 'unet')}\n"
    config = CONFIG.replace("headline:", methods + "training: {dataset: dead_leaves}\nheadline:")
    (tmp_path / "study.yaml").write_text(re.sub("targets: .*", crops, config))
    changed = layout_of(load_study(tmp_path / "study.yaml"))
    assert changed.clusters == {"astronaut-1": "astronaut", "astronaut-2": "astronaut", "still-life-1": "still-life"}
    assert changed.identities == {"none"}


def test_a_network_competes_by_whether_its_training_takes_photographs(tmp_path):
    (tmp_path / "plugins.py").write_text(PLUGINS)
    names = ("holonet", "ccnn", "tensor_holography", "unet_phase")
    nets = "".join(
        f"  - {{name: {name}, label: {name} {through}, params: {{through: {through}}}}}\n"
        for name in names
        for through in ("ideal", "parametric_model")
    )
    config = CONFIG.replace("headline:", nets + "  - hil\ntraining: {dataset: dead_leaves}\nheadline:")
    (tmp_path / "study.yaml").write_text(config)
    layout = layout_of(load_study(tmp_path / "study.yaml"))
    assert [layout.category(f"{name} ideal") for name in names] == ["open loop"] * 4
    assert [layout.category(f"{name} parametric_model") for name in names] == ["calibrated"] * 4
    assert layout.category("hil") == "calibrated"
    assert replace(layout, camera=frozenset()).spends_captures
    blind = replace(layout, camera=frozenset(), trained=layout.blind)
    assert not blind.spends_captures


def test_displays_are_described_with_version_scaling_and_the_stages_that_differ_from_the_ideal(study):
    description = describe(study)
    assert description.config_file == "study.yaml"  # of a config outside the working folder, no folder
    ideal, aged = description.displays
    assert "Version 1, sha256 " in ideal.heading
    assert any("128 x 128" in line for line in ideal.lines)
    assert not any(line.startswith("crosstalk") for line in ideal.lines)
    assert any(line.startswith("crosstalk") for line in aged.lines)
