import pytest
import torch

from holobench_eval.core.errors import CellError
from holobench_eval.display import load_profile
from holobench_eval.display.learned import LearnedBench
from holobench_eval.methods.wirtinger import Wirtinger
from tests.display.test_calibrated import Camera, Privileged

SPEC = load_profile("ideal").spec((128, 160))
DRAW = torch.Generator().manual_seed(0)
TARGET = torch.rand(3, *SPEC.region.shape, generator=DRAW)
PHASE = 6 * torch.rand(3, *SPEC.shape, generator=DRAW)


class Shade:
    """A network that predicts even light, as bright as it learned and as the phase says."""

    camera = privileged = True  # a predictor gets neither, whatever it declares

    def predict(self, phase, bench):
        assert phase.shape == (1, 3, *SPEC.shape)
        level = bench.learned["level"] * phase.mean()
        return level.expand(1, 3, *SPEC.region.shape).clone()


@pytest.fixture
def display():
    return LearnedBench(SPEC, Shade(), {"level": torch.tensor(0.25, requires_grad=True)}, 3)


def test_a_capture_is_what_the_network_predicts(display):
    shot = display.photograph(PHASE, TARGET, "t", 0)
    assert torch.equal(shot.image, torch.full_like(TARGET, float(0.25 * PHASE.mean())))
    assert torch.equal(display.rectified(shot.capture, TARGET), shot.image)
    assert not shot.image.requires_grad
    assert (shot.saturated, shot.residual) == (0, 0)
    assert shot.efficiency == pytest.approx(float((shot.image.mean((1, 2)) / TARGET.mean((1, 2))).mean()))


class Array(Shade):
    def predict(self, phase, bench):
        return super().predict(phase, bench).detach().numpy()


def test_a_capture_does_not_depend_on_repeat_or_exposure_and_may_be_an_array_of_numpy(display):
    first = display.photograph(PHASE, TARGET, "t", 0).image
    assert torch.equal(first, display.photograph(PHASE, TARGET, "t", 1, exposure="matched").image)
    assert torch.equal(first, LearnedBench(SPEC, Array(), display.learned, 3).photograph(PHASE, TARGET, "t", 0).image)


def test_a_method_with_a_camera_sees_what_is_predicted_and_is_counted(display):
    handle = display.for_method(Camera(), "camera", TARGET, "t", 0)
    image = handle.rectify(handle.capture(PHASE))
    assert torch.equal(image.cpu(), display.photograph(PHASE, TARGET, "t", 0).image)
    assert handle.captures == 1


def test_a_method_is_told_that_it_has_no_camera_and_that_there_is_no_bench_to_look_into(display):
    with pytest.raises(CellError, match="blind took a capture, but declares no camera"):  # its own mistake comes first
        display.for_method(object(), "blind", TARGET, "t", 0).capture(PHASE)
    with pytest.raises(CellError, match=r"^a learned display has no simulated bench to look into$"):
        _ = display.for_method(Privileged(), "oracle", TARGET, "t", 0).simulation


def test_what_the_display_learned_is_hidden_from_the_methods_that_are_shown_on_it(display):
    with pytest.raises(CellError, match="blind was not trained"):
        _ = display.for_method(object(), "blind", TARGET, "t", 0).learned
    assert display.for_method(object(), "own", TARGET, "t", 0, learned={"a": 1}).learned == {"a": 1}


def test_a_phase_that_no_display_can_show_is_refused_by_name(display):
    with pytest.raises(CellError, match=r"^mine: phase"):
        display.photograph(PHASE[:, :5], TARGET, "t", 0, label="mine")


def test_methods_solve_on_it_with_random_numbers_of_their_own(display):
    method = Wirtinger(iterations=2, initial_phase="random")
    first, again, other = (
        method.solve(TARGET[None], display.for_method(method, "w", TARGET, "t", repeat)) for repeat in (0, 0, 1)
    )
    assert first.shape == (1, 3, *SPEC.shape)
    assert torch.equal(first, again)
    assert not torch.equal(first, other)
