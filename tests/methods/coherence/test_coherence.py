"""A model of several lines is what the bench does, and a descent through it gains."""

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from holobench_eval.display import load_profile
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.profile import Profile
from holobench_eval.methods.calibrated.display_model import DisplayModel
from holobench_eval.methods.coherence.calibrated import SpectralDisplayModel
from holobench_eval.methods.coherence.spectral import PartiallyCoherent, intensity
from holobench_eval.methods.common import matched
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.optics.phasor import squared_modulus
from tests.support.open_loop import Bench

WIDTHS = (2.5e-8, 1.5e-8, 4.0e-8)
SIDE = 64


def led(blaze: tuple[float, float] = (0.0, 0.0), **panel: object) -> Profile:
    """The ideal display behind diodes, on a small panel; 16 bits, so that rounding does not show."""
    ideal = load_profile("ideal").scaled((SIDE, SIDE))
    return replace(
        ideal,
        panel=replace(ideal.panel, bits=16, blaze=blaze, linewidth=WIDTHS, distance=0.006, **panel),
        spectrum=replace(ideal.spectrum, width=WIDTHS, lines=7),
    )


def phases(seed: int = 0) -> Tensor:
    return 20 * torch.rand(3, SIDE, SIDE, generator=torch.Generator().manual_seed(seed)) - 10


@pytest.mark.parametrize("blaze", [(0.0, 0.0), (0.25, -0.125)])
@pytest.mark.parametrize("channel", [0, 1, 2])
def test_all_lines_together_are_the_light_of_the_bench(blaze: tuple[float, float], channel: int) -> None:
    bench, phase = SimulatedBench(led(blaze)), phases()[channel]
    region = bench.spec.region
    seen = region.crop(bench.intensity(phase, channel)[:: bench.image_samples, :: bench.image_samples])
    predicted = region.crop(intensity(phase[None], bench.spec, channel)[0])
    assert torch.corrcoef(torch.stack([seen.flatten(), predicted.flatten()]))[0, 1] > 0.999
    assert float((seen - predicted).square().mean() / seen.square().mean()) < 3e-3


def test_a_single_line_leaves_a_calibrated_model_as_it_is() -> None:
    spec, phase = load_profile("leto-aged").spec((SIDE, SIDE)), phases()
    torch.manual_seed(0)
    one, several = DisplayModel(spec), SpectralDisplayModel(spec)
    several.load_state_dict(one.state_dict())
    assert torch.allclose(several.over_panel(phase), squared_modulus(one.over_panel(phase)), atol=1e-6)


def test_a_calibrated_model_without_faults_is_the_nominal_one() -> None:
    spec, phase = led().spec(), phases()
    model = SpectralDisplayModel(spec).requires_grad_(False)
    model.crosstalk.fill_(-5)  # its width, far below a pixel
    nominal = torch.stack([intensity(colour[None], spec, channel)[0] for channel, colour in enumerate(phase)])
    assert torch.allclose(model.over_panel(phase), nominal, rtol=1e-3, atol=1e-3)


def test_a_descent_through_the_spectrum_gains_on_the_bench() -> None:
    bench = SimulatedBench(led())
    target = torch.rand(1, 3, *bench.spec.region.shape, generator=torch.Generator().manual_seed(1))
    target = torch.nn.functional.avg_pool2d(target, 5, stride=1, padding=2)

    def error(method: PartiallyCoherent | Wirtinger) -> float:
        seen = bench.spec.region.crop(bench.image(method.solve(target, Bench(bench.spec))[0]))
        return float((matched(seen, target[0]) - target[0]).square().mean())

    assert error(PartiallyCoherent(iterations=60)) < 0.85 * error(Wirtinger(iterations=60))
