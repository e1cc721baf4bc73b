import re

import pytest

from holobench_eval.report import layout_of
from holobench_eval.report.description import describe
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan

PLUGINS = """
from dataclasses import dataclass
from typing import ClassVar

@dataclass(frozen=True)
class Cards:
    def items(self):
        return ["zebra", "apple"]
    def digest(self, item):
        return item

@dataclass(frozen=True)
class Honest:
    strength: float = 0.5
    def solve(self, target, bench):
        return target

@dataclass(frozen=True)
class Knowing(Honest):
    privileged: ClassVar[bool] = True

@dataclass(frozen=True)
class Seeing(Honest):
    camera: ClassVar[bool] = True
"""
CONFIG = """
title: Two methods
seed: 7
display: {profiles: [ideal, leto-aged], panel: [128, 128]}
targets: {dataset: "plugins.py:Cards"}
methods:
  - {name: "plugins.py:Honest", label: honest}
  - {name: "plugins.py:Knowing", label: knowing, profiles: [leto-aged]}
  - {name: "plugins.py:Seeing", label: seeing, profiles: [ideal], captures: 12, params: {strength: 0.25}}
headline: ssim_linear
isolation: none
reported: {source: "a paper, table 3", rows: {honest: {psnr: 17.6}}}
"""


@pytest.fixture
def study(tmp_path):
    (tmp_path / "plugins.py").write_text(PLUGINS)
    (tmp_path / "study.yaml").write_text(CONFIG)
    return load_study(tmp_path / "study.yaml")


def test_a_layout_holds_what_the_config_orders(study):
    layout = layout_of(study)
    assert layout.pairs == (("honest", "ideal"), ("honest", "leto-aged"), ("knowing", "leto-aged"), ("seeing", "ideal"))
    assert layout.targets == ("zebra", "apple")
    assert (layout.title, layout.seed, layout.baseline, layout.headline) == ("Two methods", 7, "honest", "ssim_linear")
    assert layout.privileged == {"knowing"}
    assert layout.camera == {"seeing"}
    assert [layout.category(label) for label in layout.methods] == ["open loop", "oracle", "online"]
    assert layout.reported_metrics == ("psnr",)
    assert layout.reported_source == "a paper, table 3"


def test_a_layout_knows_how_every_cell_of_the_plan_is_made(study):
    layout = layout_of(study)
    cells = [(label, cell) for label, cell in plan(study).labelled() if label in layout.methods]
    assert len(cells) == 8
    for label, cell in cells:
        assert layout.params[label] == cell.params
        assert layout.capture_limits.get(label) == cell.captures
        assert layout.panels[cell.profile] == cell.panel
        assert layout.seed == cell.seed
    assert layout.params["seeing"] == {"strength": 0.25}
    assert (layout.study, layout.capture_limits) == ("study", {"seeing": 12})


def test_the_clusters_of_targets_are_those_of_the_dataset(study):
    assert layout_of(study).clusters == {}
    study.file.write_text(
        re.sub("targets: .*", "targets: {dataset: crops, params: {names: [astronaut], each: 2, renderings: 1}}", CONFIG)
    )
    clusters = layout_of(load_study(study.file)).clusters
    assert clusters == {"astronaut-1": "astronaut", "astronaut-2": "astronaut", "still-life-1": "still-life"}


def test_rows_whose_network_is_the_ideal_image_are_known(tmp_path):
    (tmp_path / "plugins.py").write_text(PLUGINS)
    network = '{name: hil, label: "%s", params: {network: {name: %s}}}'
    methods = f"  - {network % ('none', 'identity')}\n  - {network % ('some', 'unet')}\n"
    config = CONFIG.replace("headline:", methods + "training: {dataset: dead_leaves}\nheadline:")
    (tmp_path / "study.yaml").write_text(config)
    assert layout_of(load_study(tmp_path / "study.yaml")).identities == {"none"}


def test_displays_are_described_with_version_scaling_and_the_stages_that_differ_from_the_ideal(study):
    ideal, aged = describe(study).displays
    assert "Version 1, sha256 " in ideal.heading
    assert any("128 x 128" in line for line in ideal.lines)
    assert not any(line.startswith("crosstalk") for line in ideal.lines)
    assert any(line.startswith("crosstalk") for line in aged.lines)


def test_a_config_outside_the_working_folder_is_named_without_its_folder(study):
    assert describe(study).config_file == "study.yaml"
