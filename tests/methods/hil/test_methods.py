"""What the trained methods promise: phases for any target, no camera, and predictions of what their retrieval saw."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest
import torch
from torch import Tensor

from holobench_eval.core import plugins
from holobench_eval.core.errors import CellError, UserError
from holobench_eval.display import load_profile
from holobench_eval.display.calibrated import CalibratedBench
from holobench_eval.display.metered import MeteredDisplay
from holobench_eval.display.simulated.stages import StrayLight
from holobench_eval.display.training import TrainingBench, TrainingImage
from holobench_eval.methods.calibrated import patterns
from holobench_eval.methods.calibrated.patterns import dark_patterns
from holobench_eval.methods.hil.approximator_loss import ApproximatorLoss
from holobench_eval.methods.hil.hil import HIL
from holobench_eval.methods.hil.networks import Network
from holobench_eval.methods.hil.nh3d import HILNH3D
from holobench_eval.methods.hil.terms_first import HILTerms, WithoutCritic
from holobench_eval.methods.hil.tuned import HILTuned, SmoothStart
from holobench_eval.methods.learned import fallback
from holobench_eval.methods.learned.retrieval import PhaseRetrieval
from holobench_eval.methods.learned.samples import Schedule
from holobench_eval.methods.losses import intensity_l2
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.study.opening import open_bench
from tests.support.small_training import Memory, pictures, small_spec, solving_bench, through_a_file, training_bench

SPEC = small_spec(48, 40, colours=3)
SHORT: dict[str, Any] = {
    "training": Schedule(2, refine_images=1, steps=4, refine_steps=2),
    "start": SmoothStart(iterations=2),
}
PLAIN = PhaseRetrieval(iterations=2, perceptual=0.0, ms_ssim=0.0, adversarial=0.0)
SMALL = Network(levels=2, width=4)
METHODS: dict[str, Any] = {
    "hil": HIL(
        network=SMALL, loss=ApproximatorLoss(perceptual=0.0), retrieval=replace(PLAIN, adversarial=0.1), **SHORT
    ),
    "hil_tuned": HILTuned(
        network=SMALL, loss=ApproximatorLoss(l1=1.0, perceptual=0.0), retrieval=PLAIN, offsets=2, **SHORT
    ),
    "hil_nh3d": HILNH3D(network=Network("unet", levels=2, width=4), retrieval=PLAIN, **SHORT),
}
names = pytest.mark.parametrize("name", METHODS)


def train(method: Any, seed: int = 3) -> Mapping[str, Any]:
    """What ``prepare`` gives, as it comes back from its file."""
    bench = training_bench(SPEC, Memory(), images=2, seed=seed)
    return through_a_file(dict(method.prepare(bench)))


@pytest.fixture(scope="module")
def learned() -> dict[str, Mapping[str, Any]]:
    return {name: train(method) for name, method in METHODS.items()}


@names
def test_retrieval_moves_the_phase(name: str, learned: dict[str, Mapping[str, Any]]) -> None:
    target = pictures(SPEC, first=20)
    still = replace(METHODS[name], retrieval=replace(METHODS[name].retrieval, iterations=0))
    bench = solving_bench(still, target[0], SPEC, learned[name])
    start = still.start.solve(target, bench) + learned[name].get("offset", 0.0)
    assert torch.equal(still.solve(target, bench), start)
    assert not torch.equal(METHODS[name].solve(target, bench), start)


@names
def test_what_was_learned_is_needed_and_must_fit(name: str, learned: dict[str, Mapping[str, Any]]) -> None:
    (target,) = pictures(SPEC, first=20)
    wider = replace(METHODS[name], network=replace(METHODS[name].network, width=6))
    with pytest.raises(UserError, match="not the weights of this network"):
        wider.solve(target[None], solving_bench(wider, target, SPEC, learned[name]))
    bench = solving_bench(METHODS[name], target, SPEC, learned[name])
    bench._learned = None
    with pytest.raises(CellError, match="was not trained"):
        METHODS[name].solve(target[None], bench)


def test_the_constant_phase_is_the_one_whose_captures_are_closest_and_one_alone_needs_none() -> None:
    memory = Memory()
    bench = training_bench(SPEC, memory, images=2)
    method = replace(METHODS["hil_tuned"], offsets=4, training=Schedule(1, steps=1))
    offset = method.prepare(bench)["offset"]
    kept = memory.load("offset")
    errors = kept["value"]["errors"]
    assert offset == pytest.approx(errors.index(min(errors)) * torch.pi / 2)
    assert kept["captures"] == 4 * 2
    assert bench.captures == 4 * 2 + 2 + 1
    assert len(set(errors)) == 4
    alone = training_bench(SPEC, Memory(), images=2)
    assert replace(method, offsets=1).prepare(alone)["offset"] == 0
    assert alone.captures == 2 + 1


def test_defaults_are_a_methods_own_and_hil_starts_at_plain_wirtinger_and_captures_its_rounds_alone() -> None:
    """As published; the baseline runs Wirtinger holography to convergence, and so does hil."""
    retrieval = plugins.build("methods", "hil_plus", {"retrieval": {"iterations": 5}}).retrieval
    assert (retrieval.perceptual, retrieval.step) == (0.0, 0.1)
    assert plugins.build("methods", "hil", {}).start == plugins.build("methods", "wirtinger", {})
    bench = training_bench(SPEC, Memory(), images=2)
    learned = replace(METHODS["hil"], training=Schedule(1, steps=1)).prepare(bench)
    assert bench.captures == 2 + 1
    assert "offset" not in learned


# The third takes the way of hil.
@pytest.mark.parametrize("name", ["hil", "hil_nh3d"])
def test_the_fallback_is_taken_where_wirtinger_is_captured_closer_and_counts_its_captures(name, monkeypatch) -> None:
    method = replace(METHODS[name], fallback=True, retrieval=replace(METHODS[name].retrieval, iterations=0))
    worse = replace(method, start=SmoothStart(iterations=1))  # nothing of a picture yet
    (target,) = pictures(SPEC, first=20)
    benches = [training_bench(SPEC, Memory(), images=2) for _ in range(2)]
    off = dict(replace(worse, fallback=False).prepare(benches[0]))
    on = dict(worse.prepare(benches[1]))
    assert (off["fell_back"], on["fell_back"]) == (0, 1)
    assert benches[1].captures == benches[0].captures + 2  # one held-out image by either
    phase = worse.solve(target[None], solving_bench(worse, target, SPEC, on))
    assert torch.equal(phase, Wirtinger().solve(target[None], solving_bench(worse, target, SPEC, on)))
    monkeypatch.setattr(fallback, "WIRTINGER", Wirtinger(iterations=1))
    assert not method.prepare(training_bench(SPEC, Memory(), images=2))["fell_back"]


def test_hil_trains_and_solves_on_a_small_panel_and_says_what_its_loss_lacks() -> None:
    spec = small_spec(64, 52, colours=3)
    method = replace(METHODS["hil"], retrieval=PhaseRetrieval(iterations=2, step=0.06))
    learned = method.prepare(training_bench(spec, Memory(), images=2))
    assert learned["left_out"] == "MS-SSIM at 2 of its 5 scales and the perceptual distance"
    target = pictures(spec, first=20)
    phase = method.solve(target, solving_bench(method, target[0], spec, learned))
    assert not torch.equal(phase, method.start.solve(target, solving_bench(method, target[0], spec, learned)))


PANEL = (64, 64)


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


def test_it_stops_as_soon_as_it_may(bench: MeteredDisplay) -> None:
    """One iteration fewer than it made would not have done, each colour by itself."""
    target = dark(bench.spec.region.shape)
    phase = SmoothStart(tolerance=0.2).solve(target[None], bench)[0]
    paths = [Wirtinger(iterations=n).solve(target[None], bench)[0] for n in range(1, 40)]
    for channel in range(3):
        errors = [error(path, target, bench, channel) for path in paths]
        first = next(index for index, value in enumerate(errors) if value <= 0.2)
        torch.testing.assert_close(phase[channel], paths[first][channel])


def test_every_colour_ends_within_the_tolerance_and_an_image_not_by_those_beside_it(bench: MeteredDisplay) -> None:
    pair = torch.stack([bright(bench.spec.region.shape), dark(bench.spec.region.shape)])
    start = SmoothStart(tolerance=0.2)
    together = start.solve(pair, bench)
    assert torch.equal(together, torch.cat([start.solve(image[None], bench) for image in pair]))
    assert max(error(together[1], pair[1], bench, channel) for channel in range(3)) <= 0.2


def test_tolerance_zero_is_wirtinger_and_one_that_would_not_be_heeded_is_refused(bench: MeteredDisplay) -> None:
    target = bright(bench.spec.region.shape)[None]
    starts = SmoothStart(iterations=6, tolerance=0), Wirtinger(iterations=6)
    assert torch.equal(*(start.solve(target, bench) for start in starts))
    for other in ({"optimiser": "lbfgs"}, {"loss": "amplitude_l2"}):
        with pytest.raises(UserError, match="set it to 0"):
            plugins.build("methods", "hil_tuned", {"start": {"tolerance": 0.1, **other}})


HAZY_PANEL = (120, 120)
TERMS = HILTerms(
    training=Schedule(rounds=1, steps=250),
    retrieval=WithoutCritic(iterations=2),
    start=Wirtinger(iterations=20),
    network=Network("unet", levels=2, width=4),
)


def hazy_display() -> CalibratedBench:
    """Of one laser: haze is the same in each."""
    profile = load_profile("ideal").scaled(HAZY_PANEL)
    panel = replace(profile.panel, wavelengths=(5.17e-7,))
    return open_bench(replace(profile, panel=panel, stray_light=StrayLight(0.5, 0.125)), HAZY_PANEL, 0)


def lost_beside_the_dark(even: Tensor, half: Tensor) -> float:
    """Share of its light that the lit half loses in the sixth of it beside the dark one, against its far third, once
    the other half is dark; of captures ``(C, h, w)``."""
    width = even.shape[-1]
    near, far = slice(width // 2 + 2, width // 2 + width // 12), slice(-width // 6, None)
    ratios = [image[..., near].mean() / image[..., far].mean() for image in (even, half)]
    return float(1 - ratios[1] / ratios[0])


def test_it_loses_the_light_beside_a_dark_half_that_the_display_loses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(patterns, "Wirtinger", lambda: Wirtinger(iterations=40))
    display = hazy_display()
    images = [TrainingImage(f"picture {number}", picture) for number, picture in enumerate(pictures(display.spec, 4))]
    bench = TrainingBench(display, "hil_terms", images[:3], images[3:], Memory(), None, 0)
    learned = TERMS.prepare(bench)
    assert bench.captures == 3 + 3 + 1

    gray = torch.full_like(images[0].target, 0.5)
    right = 1 - dark_patterns(gray[0])["left half"]
    captured, predicted = [], []
    for target in (gray, gray * right):
        handle = display.for_method(TERMS, "hil_terms", gray, "probe", 0, learned=learned)
        phase = Wirtinger().solve(target[None], handle)
        captured.append(display.rectified(display.session(("probe",), gray).capture(phase[0]), gray))
        predicted.append(TERMS.predict(phase, handle)[0])
    lost, expected = lost_beside_the_dark(*captured), lost_beside_the_dark(*predicted)
    assert lost > 0.1
    assert abs(expected - lost) < 0.2 * lost
