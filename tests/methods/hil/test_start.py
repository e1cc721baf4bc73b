"""The start of learned phase retrieval: Wirtinger holography stopped at a tolerance."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from holobench_eval.core import plugins
from holobench_eval.core.errors import UserError
from holobench_eval.display import load_profile
from holobench_eval.display.metered import MeteredDisplay
from holobench_eval.methods.hil.tuned import SmoothStart
from holobench_eval.methods.losses import intensity_l2
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.study.opening import open_bench

PANEL = (96, 96)


@pytest.fixture(scope="module")
def bench() -> MeteredDisplay:
    workbench = open_bench(load_profile("ideal"), PANEL)
    return MeteredDisplay(workbench, "start", bright(workbench.spec.region.shape), ("test",))


def bright(shape: tuple[int, int]) -> Tensor:
    """A busy picture in three colours."""
    return torch.rand((3, *shape), generator=torch.Generator().manual_seed(1))


def dark(shape: tuple[int, int]) -> Tensor:
    """Black but for a few lights."""
    image = torch.zeros(3, *shape)
    image[:, 10::23, 7::29] = 1.0
    return image


def error(phase: Tensor, target: Tensor, bench: MeteredDisplay, channel: int) -> float:
    """Relative squared error of the ideal picture of a colour."""
    field = bench.spec.propagator(channel).forward(torch.polar(torch.ones_like(phase), phase)[None, channel])
    intensity = bench.spec.region.crop(field.abs().square())
    return float(intensity_l2(intensity, target[None, channel]))


def test_every_colour_ends_within_the_tolerance(bench: MeteredDisplay) -> None:
    target = dark(bench.spec.region.shape)
    phase = SmoothStart(tolerance=0.2).solve(target[None], bench)[0]
    assert max(error(phase, target, bench, channel) for channel in range(3)) <= 0.2


def test_it_stops_as_soon_as_it_may(bench: MeteredDisplay) -> None:
    """One iteration fewer than it made would not have done."""
    target = bright(bench.spec.region.shape)
    phase = SmoothStart(tolerance=0.2).solve(target[None], bench)[0]
    paths = [Wirtinger(iterations=n).solve(target[None], bench)[0] for n in range(1, 40)]
    for channel in range(3):
        errors = [error(path, target, bench, channel) for path in paths]
        first = next(index for index, value in enumerate(errors) if value <= 0.2)
        torch.testing.assert_close(phase[channel], paths[first][channel])


def test_an_image_does_not_depend_on_those_beside_it(bench: MeteredDisplay) -> None:
    pair = torch.stack([bright(bench.spec.region.shape), dark(bench.spec.region.shape)])
    start = SmoothStart(tolerance=0.2)
    together = start.solve(pair, bench)
    assert torch.equal(together, torch.cat([start.solve(image[None], bench) for image in pair]))


def test_tolerance_zero_is_wirtinger_holography(bench: MeteredDisplay) -> None:
    target = bright(bench.spec.region.shape)[None]
    assert torch.equal(
        SmoothStart(iterations=6, tolerance=0).solve(target, bench), Wirtinger(iterations=6).solve(target, bench)
    )


@pytest.mark.parametrize("other", [{"optimiser": "lbfgs"}, {"loss": "amplitude_l2"}])
def test_a_tolerance_that_would_not_be_heeded_is_refused(other: dict[str, str]) -> None:
    with pytest.raises(UserError, match="set it to 0"):
        plugins.build("methods", "hil_tuned", {"start": {"tolerance": 0.1, **other}})
