from dataclasses import dataclass
from itertools import pairwise

import pytest
import torch

from holobench_eval.methods.hil.networks import Network
from holobench_eval.methods.learned.samples import Sample
from holobench_eval.methods.losses import intensity_l2
from holobench_eval.methods.online.camera import OnlineCamera
from holobench_eval.methods.online.network import OnlineCameraNetwork, ShortRetrieval, corrected
from holobench_eval.methods.online.start import Camera, CameraStart, captured_error
from holobench_eval.methods.wirtinger import Objective, Wirtinger
from tests.support.toy_camera import SPEC, Plug, ToyDisplay, picture

FAULTY = {"aberration": 0.6, "unmodulated": 0.3}
QUICK = CameraStart(converged=Wirtinger(iterations=60))
TINY = Network(levels=2, width=4)


@dataclass(frozen=True)
class WithNetwork(OnlineCameraNetwork):
    """With a small network, trained in few steps."""

    network: Network = TINY
    steps: int = 2


def solved(display, target, budget=None, of=OnlineCamera, **params):
    method = of(start=QUICK, **params)
    handle = display.handle(method, target, budget)
    return method.solve(target[None], handle)[0], handle


def nominal(display, target):
    return QUICK.nominal(target, display.handle(object(), target))


def test_captures_correct_what_the_nominal_model_does_not_know():
    display, target = ToyDisplay(**FAULTY, noise=0.01), picture()
    phase, _ = solved(display, target, captures=100)
    assert (display.error(phase, target) < 0.5 * display.error(nominal(display, target), target)).all()


def test_on_an_ideal_display_it_is_wirtinger_holography_or_better():
    display, target = ToyDisplay(), picture()
    phase, _ = solved(display, target, captures=60)
    assert (display.error(phase, target) <= display.error(nominal(display, target), target)).all()


@pytest.mark.parametrize("faults", [{}, FAULTY])
def test_strong_noise_does_not_make_it_worse_than_wirtinger_holography(faults):
    display, target = ToyDisplay(**faults, noise=0.3), picture()
    phase, _ = solved(display, target, captures=60)
    assert (display.scored(phase, target) < 1.02 * display.scored(nominal(display, target), target)).all()


def test_its_gradient_is_the_wirtinger_gradient_where_the_display_is_ideal():
    display, target = ToyDisplay(), picture()
    method, phase = OnlineCamera(smoothing=0), Wirtinger(iterations=5).solve(picture()[None], display.handle(0, target))
    gradient = method._gradient(phase[0], display.image(phase[0]), target, SPEC)
    for colour, found in enumerate(gradient):
        objective = Objective(SPEC.propagator(colour), SPEC.region, target[colour][None], intensity_l2)
        _, wanted = objective.evaluate(phase[:, colour])
        assert torch.cosine_similarity(found.flatten(), wanted.flatten(), dim=0) > 0.9999


@pytest.mark.parametrize("captures", [1, 3, 9, 37])
def test_it_stops_at_its_captures(captures):
    display, target = ToyDisplay(**FAULTY), picture()
    phase, handle = solved(display, target, captures=captures)
    assert captures - 3 < handle.captures <= captures
    assert phase.isfinite().all()


def test_its_schedule_is_planned_for_the_budget_of_the_display():
    display, target = ToyDisplay(**FAULTY, noise=0.01), picture()
    within, handle = solved(display, target, budget=30, captures=200)
    assert handle.captures == 30
    assert torch.equal(within, solved(display, target, captures=30)[0])


def test_averaged_frames_and_a_batch_share_the_captures():
    display, targets = ToyDisplay(**FAULTY, noise=0.1), torch.stack([picture(), picture(1)])
    assert 46 < solved(display, targets[0], captures=50, frames=4)[1].captures <= 50
    handle = display.handle(method := OnlineCamera(start=QUICK), targets[0], 41)
    assert method.solve(targets, handle).shape == (2, 2, *SPEC.shape)
    assert handle.captures == 40


ENDS = {OnlineCamera: (0, 1, 12, 39), WithNetwork: (0, 9, 30)}


@pytest.mark.parametrize(("of", "at"), [(of, at) for of, ends in ENDS.items() for at in ends])
def test_a_display_that_ends_the_captures_has_a_hologram_as_good_as_the_nominal_one(of, at):
    display, target = ToyDisplay(**FAULTY), picture()
    method = of(start=QUICK, captures=40)
    plug = Plug(display.handle(method, target), at)
    with pytest.raises(Exception, match="plug pulled"):
        method.solve(target[None], plug)
    assert (display.error(plug.kept, target) <= display.error(nominal(display, target), target)).all()


def test_what_is_handed_in_gets_better_every_time(monkeypatch):
    display, target, errors = ToyDisplay(**FAULTY), picture(), []
    handle = display.handle(method := OnlineCamera(start=QUICK, captures=40), target)
    monkeypatch.setattr(handle, "keep", lambda phase: errors.append(display.error(phase, target)))
    method.solve(target[None], handle)
    assert len(errors) > 5
    assert all((later <= earlier + 1e-7).all() for earlier, later in pairwise(errors))


def test_each_colour_keeps_its_own_best():
    display, target = ToyDisplay(), picture()
    good = nominal(display, target)
    halves = [torch.stack([good[0], torch.zeros(SPEC.shape)]), torch.stack([torch.zeros(SPEC.shape), good[1]])]
    camera = Camera(display.handle(OnlineCamera(), target), target, halves[0], 10)
    for half in halves:
        camera.show(half)
    assert torch.equal(camera.best, good)
    assert torch.equal(camera.settle(halves, 2), good)


class Lucky(ToyDisplay):
    """The first frame is without noise, and all later ones are not."""

    def session(self, names, target):
        return self

    def announce(self, phases):
        pass

    def capture(self, phase):
        capture = super().capture(phase)
        self.noise = 2.0
        return capture


def test_a_lucky_draw_is_found_out_by_fresh_frames():
    display, target = Lucky(), picture()
    good = nominal(display, target)
    poor = good + 0.3 * torch.randn(good.shape, generator=torch.Generator().manual_seed(0))
    camera = Camera(display.handle(OnlineCamera(), target), target, good, 20)
    camera.show(poor)
    camera.show(good)
    assert torch.equal(camera.best, poor)
    assert torch.equal(camera.settle([poor, good], 8), good)


def test_the_start_has_the_offset_at_which_unmodulated_light_does_least_harm():
    display, target = ToyDisplay(unmodulated=0.4), picture()
    handle = display.handle(OnlineCamera(), target)
    camera = Camera(handle, target, nominal(display, target), 200)
    start = QUICK.search(target, handle, camera, nominal(display, target))
    early = QUICK.early.solve(target[None], handle)[0]
    tried = torch.stack([display.error(early + k * torch.pi / 4, target) for k in range(8)])
    assert torch.allclose(display.error(start, target), tried.amin(0), rtol=1e-3)
    assert (tried.amax(0) > 1.2 * tried.amin(0)).all()


def test_the_captured_error_is_the_one_that_is_scored():
    target = picture()
    assert float(captured_error(3 * target, target).max()) < 1e-12
    bright = target.clone()
    bright[:, 20, 20] = 50
    factor = (bright * target).sum((1, 2), True) / bright.square().sum((1, 2), True)
    wanted = ((factor * bright).clamp(0, 1) - target).square().mean((1, 2))
    assert torch.allclose(captured_error(bright, target), wanted)


SMALL = {"of": OnlineCameraNetwork, "network": TINY}


def test_rounds_of_captures_improve_the_hologram():
    display, target = ToyDisplay(**FAULTY, noise=0.01), picture()
    started, _ = solved(display, target, **SMALL, captures=20, retrieval=ShortRetrieval(iterations=0))
    phase, handle = solved(display, target, **SMALL)
    assert handle.captures <= 100
    assert (display.error(phase, target) < 0.8 * display.error(started, target)).all()
    assert (display.error(phase, target) < 0.5 * display.error(nominal(display, target), target)).all()


@pytest.mark.parametrize(("faults", "noise"), [({}, 0.0), (FAULTY, 0.3)])
def test_neither_an_ideal_display_nor_noise_makes_it_worse_than_wirtinger_holography(faults, noise):
    display, target = ToyDisplay(**faults, noise=noise), picture()
    phase, _ = solved(display, target, **SMALL, captures=42)
    assert (display.scored(phase, target) < 1.02 * display.scored(nominal(display, target), target)).all()


@pytest.mark.parametrize("budget", [1, 8, 40])
def test_it_stays_within_the_budget_of_the_display(budget):
    phase, handle = solved(ToyDisplay(**FAULTY), picture(), budget, **SMALL, steps=1)
    assert handle.captures <= budget
    assert phase.isfinite().all()


def test_what_the_prediction_misses_of_the_captures_is_added_to_it():
    gray, phases = torch.full((2, 16, 16), 0.5), [torch.full((2, 1, 1), value) for value in (0.1, 0.5)]
    captures = [gray + 2 * phase for phase in phases]
    samples = [Sample(*pair, gray, torch.ones(2)) for pair in zip(phases, captures, strict=True)]
    display = corrected(lambda phase: gray + phase, samples)
    assert torch.allclose(display(torch.zeros(2, 1, 1)), gray + 0.3, atol=1e-6)
