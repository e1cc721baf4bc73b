from dataclasses import replace

import pytest
import torch

from holobench_eval.display import CalibratedBench, load_profile
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.methods import fiducials
from holobench_eval.methods.fiducials import fiducial_phases

PANEL = (64, 64)


def opened(profile: str, seed: int = 1, panel: tuple[int, int] = PANEL) -> CalibratedBench:
    return CalibratedBench(SimulatedBench(load_profile(profile).scaled(panel)), seed, fiducial_phases)


def grid_of(display: CalibratedBench) -> torch.Tensor:
    return torch.eye(*display.spec.region.shape).expand(len(display.spec.wavelengths), -1, -1)


def test_displays_with_the_same_optics_share_their_holograms_and_others_do_not(monkeypatch: pytest.MonkeyPatch) -> None:
    solved: list[str] = []
    original = fiducials._hologram

    def noted(display: CalibratedBench, target: torch.Tensor, number: int) -> torch.Tensor:
        solved.append(display.spec.name)
        return original(display, target, number)

    monkeypatch.setattr(fiducials, "_hologram", noted)
    fiducials._solved.clear()
    aged, ideal = opened("leto-aged"), opened("ideal")
    assert replace(aged.spec, name="") == replace(ideal.spec, name="")
    first, second = (fiducial_phases(display, grid_of(display)) for display in (aged, ideal))
    assert solved == ["leto-aged"] * fiducials.HOLOGRAMS
    assert first.keys() == second.keys()
    assert all(torch.equal(first[name], second[name]) for name in first)
    first[0, 0].zero_()  # whoever gets them may change them
    for display, target in (
        (opened("ideal", seed=2), grid_of(ideal)),
        (ideal, grid_of(ideal).flip(-1)),
        (opened("ideal", panel=(72, 64)), None),
    ):
        other = fiducial_phases(display, grid_of(display) if target is None else target)
        assert other[0, 0].shape != second[0, 0].shape or not torch.equal(other[0, 0], second[0, 0])
    assert torch.equal(fiducial_phases(ideal, grid_of(ideal))[0, 0], second[0, 0])
