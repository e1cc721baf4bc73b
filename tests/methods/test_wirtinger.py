import pytest
import torch
from torch import Tensor

from holobench_eval.core.errors import UserError
from holobench_eval.methods.common import nominal_model
from holobench_eval.methods.descent import Best, cosine_decay
from holobench_eval.methods.losses import LOSSES
from holobench_eval.methods.wirtinger import Objective, Wirtinger


def objective(bench, target: Tensor, loss: str) -> Objective:
    return Objective(nominal_model(bench, 0, target), bench.spec.region, target, LOSSES[loss])


def smooth_start(bench, batch: int = 1) -> Tensor:
    draw = torch.Generator().manual_seed(5)
    return 2 * torch.rand(batch, *bench.spec.shape, dtype=torch.float64, generator=draw)


def pair(make_bench, scene, loss: str, pupil: float | None = None) -> tuple[Objective, Tensor]:
    """An objective and a phase, in double precision; MS-SSIM needs a region of 161 px for its five scales."""
    bench = make_bench(size=176, region=162, pupil=pupil) if loss == "ms_ssim" else make_bench(pupil=pupil)
    target = scene(size=bench.spec.region.height, dtype=torch.float64)[:, 0]
    return objective(bench, target, loss), smooth_start(bench)


@pytest.mark.parametrize("pupil", [None, 0.7])
@pytest.mark.parametrize("loss", list(LOSSES))
def test_the_gradient_equals_autograd(loss, pupil, make_bench, scene):
    problem, phase = pair(make_bench, scene, loss, pupil)
    value, gradient = problem.evaluate(phase)
    phase = phase.requires_grad_()
    field = problem.model.forward(torch.polar(torch.ones_like(phase), phase))
    expected = problem.loss(problem.region.crop(field).abs().square(), problem.target)
    expected.sum().backward()
    assert torch.allclose(value, expected.detach())
    assert (gradient - phase.grad).norm() < 1e-10 * gradient.norm()


def test_a_phase_of_another_size_is_refused(make_bench, scene):
    problem, phase = pair(make_bench, scene, "intensity_l2")
    for wrong in (phase[..., :-1], phase[..., :1], torch.zeros(1, *problem.model.padded_shape).double()):
        with pytest.raises(ValueError, match="made for"):
            problem.evaluate(wrong)


def test_single_precision_is_enough_for_the_sums_of_a_batch_of_large_images():
    draw = torch.Generator().manual_seed(4)
    image, target = torch.rand(2, 2, 1080, 1920, generator=draw)
    exact = LOSSES["intensity_l2"](image.double(), target.double())
    assert torch.allclose(LOSSES["intensity_l2"](image, target).double(), exact, rtol=1e-5)


@pytest.mark.parametrize("loss", list(LOSSES))
@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_a_loss_does_not_depend_on_the_light_at_the_image(loss, factor, scene):
    target = scene(size=162, dtype=torch.float64)[:, 0]
    image = scene(size=162, batch=2, dtype=torch.float64)[1:, 0] + 0.1
    assert torch.allclose(LOSSES[loss](factor * image, target), LOSSES[loss](image, target))
    assert torch.allclose(LOSSES[loss](factor * target, target), torch.zeros(1, dtype=torch.float64), atol=1e-9)


@pytest.mark.parametrize("loss", ["intensity_l2", "amplitude_l2", "intensity_l1"])
def test_a_loss_does_not_depend_on_the_brightness_of_the_target(loss, scene):
    target, image = scene(batch=2, dtype=torch.float64)[:, 0].split(1)
    assert torch.allclose(LOSSES[loss](image, 0.2 * target), LOSSES[loss](image, target))


def test_the_scale_is_the_least_squares_one(scene):
    target, image = scene(batch=2, dtype=torch.float64)[:, 0].split(1)
    best = LOSSES["intensity_l2"](image, target)
    for factor in (0.5, 0.7, 1.0, 1.3):
        assert best <= (factor * image - target).square().sum() / target.square().sum()


@pytest.mark.parametrize("loss", list(LOSSES))
def test_descent_lowers_the_loss(loss, make_bench, scene):
    problem, _ = pair(make_bench, scene, loss)
    bench = make_bench(size=176, region=162) if loss == "ms_ssim" else make_bench()
    target = problem.target[:, None]
    first, last = (problem.evaluate(Wirtinger(iterations=n, loss=loss).solve(target, bench)[:, 0])[0] for n in (1, 25))
    assert last < 0.5 * first


def test_the_returned_phase_has_the_least_loss_seen(bench, scene, monkeypatch):
    seen: list[float] = []
    evaluate = Objective.evaluate

    def recorded(self: Objective, phase: Tensor) -> tuple[Tensor, Tensor]:
        loss, gradient = evaluate(self, phase)
        seen.append(float(loss))
        return loss, gradient

    monkeypatch.setattr(Objective, "evaluate", recorded)
    target = scene(dtype=torch.float64)
    # so large a step that the last phase is not the best
    phase = Wirtinger(iterations=40, step=4.0, offset="none").solve(target, bench)[:, 0]
    least, last = min(seen), seen[-1]
    assert least < last
    assert float(evaluate(objective(bench, target[:, 0], "intensity_l2"), phase)[0]) == pytest.approx(least)


def test_the_best_phase_is_a_copy_and_chosen_image_by_image():
    phase = torch.zeros(2, 3, 3)
    best = Best(phase)
    best.update(torch.tensor([1.0, 2.0]), phase)
    phase += 1
    best.update(torch.tensor([2.0, 1.0]), phase)
    phase += 1
    assert best.phase[0].eq(0).all()
    assert best.phase[1].eq(1).all()
    assert best.loss.tolist() == [1.0, 1.0]


def test_lbfgs_goes_at_least_as_far_as_adam_in_as_many_evaluations(bench, scene):
    target = scene(dtype=torch.float64)
    losses = {}
    for optimiser in ("adam", "lbfgs"):
        phase = Wirtinger(iterations=60, optimiser=optimiser).solve(target, bench)[:, 0]
        losses[optimiser] = float(objective(bench, target[:, 0], "intensity_l2").evaluate(phase)[0])
    assert losses["lbfgs"] <= losses["adam"]


@pytest.mark.parametrize("start", ["random", "narrow", "constant", "quadratic", "dpe"])
def test_every_start_leads_to_an_image(start, bench, scene, linear_psnr):
    target = scene()
    phase = Wirtinger(initial_phase=start).solve(target, bench)
    assert linear_psnr(phase, target, bench) > 25


def test_the_defaults_reach_35_db_on_an_ideal_display(bench, scene, linear_psnr):
    target = scene(channels=3)
    assert linear_psnr(Wirtinger().solve(target, bench), target, bench) > 35


def test_ms_ssim_refuses_a_region_too_small_for_its_scales(bench, scene):
    with pytest.raises(UserError, match="161"):
        Wirtinger(loss="ms_ssim").solve(scene(), bench)


def test_a_cosine_step_starts_whole_and_falls_to_nothing():
    steps = [cosine_decay(0.2, i / 10) for i in range(11)]
    assert steps[0] == pytest.approx(0.2)
    assert steps[5] == pytest.approx(0.1)
    assert steps[10] == pytest.approx(0.0)
    assert steps == sorted(steps, reverse=True)


def test_a_decaying_step_changes_the_path(bench, scene):
    target = scene()
    steady, decaying = (Wirtinger(iterations=5, schedule=s).solve(target, bench) for s in ("constant", "cosine"))
    assert not torch.allclose(steady, decaying, atol=1e-3)
