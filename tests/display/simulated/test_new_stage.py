"""A new stage costs one file and one field of Profile, wherever it acts on the light."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

import holobench_eval
from holobench_eval import methods
from holobench_eval.display import Profile
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.profile import STAGES
from holobench_eval.display.simulated.stages import DustPlane

ROOT = Path(__file__).parents[3]
STAGE = '''
"""A neutral-density filter before the camera."""

from dataclasses import dataclass
from typing import ClassVar

from ..stage import Effect, Stage


@dataclass(frozen=True)
class NeutralDensity(Stage):
    """Passes ``10^-density`` of the power."""

    title: ClassVar[str] = "neutral-density filter"
    model: ClassVar[str] = "an even loss"

    density: float = 0.0

    def effects(self, profile):
        if self.density:
            yield Effect("neutral_density", f"a filter of density {self.density:g}")

    def image(self, light, profile, geometry):
        return light * 10**-self.density
'''
IMPORT = "from .stages.neutral_density import NeutralDensity\n"
FIELD = "    neutral_density: NeutralDensity = NeutralDensity()\n"
USE = """
import sys

import torch

from holobench_eval.display import load_profile
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.profile import STAGES

clear, filtered = (load_profile(name).scaled((64, 64)) for name in ("ideal", sys.argv[1]))
phase = torch.rand(3, 64, 64)
assert torch.allclose(SimulatedBench(filtered).image(phase), SimulatedBench(clear).image(phase) / 100)
assert {"neutral_density"} == {e.name for e in filtered.effects()} - {e.name for e in clear.effects()}
names = list(STAGES)
assert names.index("zero_order") < names.index("neutral_density") < names.index("sensor")
"""


def test_a_stage_is_one_file_and_one_field(tmp_path: Path) -> None:
    package = tmp_path / "holobench_eval"
    unfinished = shutil.ignore_patterns("*.pyc.*", "*.tmp.*")  # what is compiled is copied, which saves seconds
    shutil.copytree(Path(holobench_eval.__file__).parent, package, ignore=unfinished)
    shutil.copytree(Path(str(methods.__file__)).parent, package / "methods", ignore=unfinished)
    folder = package / "display" / "simulated"
    (folder / "stages" / "neutral_density.py").write_text(STAGE)
    text = (folder / "profile.py").read_text()
    for before, line in (("from .stage import", IMPORT), ("    relay: kinds.Relay", FIELD)):
        assert before in text
        text = text.replace(before, line + before, 1)
    (folder / "profile.py").write_text(text)
    ideal = (folder / "profiles" / "ideal.yaml").read_text()
    (tmp_path / "mine.yaml").write_text(f"{ideal}\nneutral_density: {{density: 2}}\n")
    command = [sys.executable, "-c", USE, "mine.yaml"]
    given = {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run(command, cwd=tmp_path, env=given, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def acting(**hooks: Callable[..., Any]) -> DustPlane:
    """A stage with the given hooks, in the place of one that has none."""
    return dataclass(frozen=True)(type("Acting", (DustPlane,), hooks))()


@pytest.fixture
def intensity(ideal: Profile, phase: Tensor) -> Callable[..., Tensor]:
    """Light on the sensor with a stage that has the given hooks; green."""
    return lambda **hooks: SimulatedBench(replace(ideal, dust_plane=acting(**hooks))).integrated(phase[1], 1)


def test_a_stage_may_change_the_hologram_and_the_light_anywhere(intensity, ideal: Profile, phase: Tensor) -> None:
    turned, plain = intensity(hologram=lambda _, geometry: phase[0]), intensity()
    assert torch.allclose(turned, SimulatedBench(ideal).integrated(phase[0] + phase[1], 1), atol=1e-5)
    assert torch.allclose(intensity(panel=lambda _, geometry: torch.tensor(0.5)), plain / 4, rtol=1e-4)
    assert torch.allclose(intensity(transmission=lambda *_: torch.tensor(0.5)), plain / 4, rtol=1e-4)
    scattered = intensity(image=lambda _, light, *args: 0.9 * light + 0.1 * light.mean())
    assert torch.allclose(scattered, 0.9 * plain + 0.1 * plain.mean(), atol=1e-5)


def test_lines_of_a_source_add_in_intensity(intensity: Callable[..., Tensor]) -> None:
    def line(shift: float) -> Callable[..., Any]:
        return lambda _, geometry: ((1.0, replace(geometry, wavelength=geometry.wavelength * (1 + shift))),)

    short, long = line(-0.02), line(0.02)
    broad = intensity(spectrum=lambda *args: [(0.5, geometry) for of in (short, long) for _, geometry in of(*args)])
    alone = [intensity(spectrum=of) for of in (short, long)]
    assert torch.allclose(broad, sum(alone) / 2, atol=1e-5)
    assert not torch.allclose(*alone, rtol=0.1)


def test_the_page_of_the_bench_lists_the_stages_in_lights_order() -> None:
    text = " ".join((ROOT / "docs" / "bench.md").read_text().split())
    assert ", ".join(stage.title for stage in STAGES.values()) in text
