import math

import pytest
import torch
from torch import Tensor

from holobench_eval.core.errors import UserError
from holobench_eval.methods.common import nominal_model
from holobench_eval.methods.descent import Best, cosine_decay
from holobench_eval.methods.double_phase import AntiAliasedDoublePhase, BandLimitedDoublePhase, DoublePhase, encode
from holobench_eval.methods.losses import LOSSES
from holobench_eval.methods.multi_plane import MultiPlane
from holobench_eval.methods.wirtinger import Objective, Wirtinger
from holobench_eval.optics.convolution import frequencies, iris


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


def test_a_loss_does_not_depend_on_the_brightness_of_the_target_and_its_scale_is_the_least_squares_one(scene):
    target, image = scene(batch=2, dtype=torch.float64)[:, 0].split(1)
    for loss in ("intensity_l2", "amplitude_l2", "intensity_l1"):
        assert torch.allclose(LOSSES[loss](image, 0.2 * target), LOSSES[loss](image, target)), loss
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


def test_the_defaults_reach_35_db_and_ms_ssim_refuses_a_region_too_small_for_its_scales(bench, scene, linear_psnr):
    target = scene(channels=3)
    assert linear_psnr(Wirtinger().solve(target, bench), target, bench) > 35
    with pytest.raises(UserError, match="161"):
        Wirtinger(loss="ms_ssim").solve(target, bench)


def test_a_cosine_step_starts_whole_and_falls_to_nothing_on_another_path(bench, scene):
    steps = [cosine_decay(0.2, i / 10) for i in range(11)]
    assert steps[::5] == pytest.approx([0.2, 0.1, 0.0])
    assert steps == sorted(steps, reverse=True)
    target = scene()
    steady, decaying = (Wirtinger(iterations=5, schedule=s).solve(target, bench) for s in ("constant", "cosine"))
    assert not torch.allclose(steady, decaying, atol=1e-3)


OFFSETS = [-4e-4, 0.0, 4e-4]


@pytest.fixture
def stack(scene):
    """Three pictures that differ, (3, 1, h, w)."""
    return torch.cat([scene(), scene().flip(-1), scene().flip(-2)])


def at(bench, make_bench, offset, **changes):
    """The bench with its image plane moved."""
    return make_bench(distance=bench.spec.distance + offset, **changes)


def test_one_plane_is_wirtinger_holography(bench, scene):
    target = scene(batch=2, channels=3)
    assert torch.equal(MultiPlane(iterations=15).solve(target, bench), Wirtinger(iterations=15).solve(target, bench))
    alone = MultiPlane(iterations=15).solve_planes(target[:1], [0.0], bench)
    assert torch.equal(alone, MultiPlane(iterations=15).solve(target[:1], bench)[0])


def test_every_plane_is_better_than_with_a_hologram_of_the_middle_one(make_bench, stack, linear_psnr):
    bench = make_bench(pupil=0.8)
    joint = MultiPlane(iterations=80).solve_planes(stack, OFFSETS, bench)[None]
    middle = Wirtinger(iterations=80).solve(stack[1:2], bench)
    for index in (0, 2):
        there = at(bench, make_bench, OFFSETS[index], pupil=0.8)
        target = stack[index : index + 1]
        assert linear_psnr(joint, target, there) > linear_psnr(middle, target, there) + 3


def test_a_positive_offset_is_farther_from_the_panel(make_bench, scene, linear_psnr):
    bench, target = make_bench(pupil=0.8), scene()
    phase = MultiPlane(iterations=60).solve_planes(target, [4e-4], bench)[None]
    far, near = (at(bench, make_bench, offset, pupil=0.8) for offset in (4e-4, -4e-4))
    assert linear_psnr(phase, target, far) > linear_psnr(phase, target, near) + 6


def band_limited_field(size: int, band: float) -> torch.Tensor:
    """A random complex field whose spectrum ends at ``band`` of the panel's band, around a carrier-free mean."""
    draw = torch.Generator().manual_seed(3)
    noise = torch.randn(size, size, dtype=torch.complex128, generator=draw)
    passed = iris(*frequencies((size, size), 1.0), 1.0, band)
    field = torch.fft.ifft2(torch.fft.fft2(noise) * passed)
    return 1 + 0.6 * field / field.abs().max()


def behind_iris(field: torch.Tensor, band: float) -> torch.Tensor:
    return torch.fft.ifft2(torch.fft.fft2(field) * iris(*frequencies(field.shape, 1.0), 1.0, band))


def test_two_neighbours_average_to_the_field():
    field = torch.full((4, 6), 0.3 + 0.4j, dtype=torch.complex128)
    field[0, 0] = 1.0
    shown = torch.polar(torch.ones(4, 6, dtype=torch.float64), encode(field))
    assert torch.allclose((shown[2, 2] + shown[2, 3]) / 2, field[2, 2])
    assert torch.allclose((shown[2, 2] + shown[3, 2]) / 2, field[2, 2])


@pytest.mark.parametrize("size", [64, 63])
def test_an_iris_gives_a_band_limited_field_back(size):
    band = 0.25
    field = band_limited_field(size, band)
    shown = torch.polar(torch.ones(size, size, dtype=torch.float64), encode(field)) * field.abs().max()
    seen = behind_iris(shown, band)
    # away from the border, where an odd panel breaks the checkerboard of a periodic transform
    error = (seen - field)[8:-8, 8:-8].norm() / field[8:-8, 8:-8].norm()
    assert error < 0.02
    assert (shown - field).norm() / field.norm() > 0.3


def test_a_lower_quantile_gives_more_light_and_equal_phase_where_nothing_is_cut(make_bench, scene):
    bench, target = make_bench(pupil=0.8), scene()
    light = []
    for quantile in (1.0, 0.9):
        phase = DoublePhase(quantile=quantile, offset="none").solve(target, bench)[:, 0]
        field = bench.spec.propagator(0).forward(torch.polar(torch.ones_like(phase), phase))
        light.append(float(field.abs().square().sum()))
    assert light[1] > 1.05 * light[0]


def test_the_anti_aliasing_blur_damps_a_wave_by_its_gaussian():
    rows = torch.arange(128, dtype=torch.float64)[:, None]
    wave = torch.polar(torch.ones(128, 128, dtype=torch.float64), 2 * math.pi * 0.25 * rows.expand(128, 128))
    seen = AntiAliasedDoublePhase(sigma=0.7).filter(wave, 6.4e-6)[64, 64].abs()
    assert seen == pytest.approx(math.exp(-2 * (math.pi * 0.7 * 0.25) ** 2), abs=1e-4)


@pytest.mark.parametrize(
    ("cycles", "shape", "passes"),
    [((0, 0.2), "round", 1), ((0, 0.3), "round", 0), ((0.2, 0.2), "round", 0), ((0.2, 0.2), "square", 1)],
)
def test_the_band_limit_passes_inside_and_stops_outside_and_a_square_one_passes_the_corners(cycles, shape, passes):
    line = torch.arange(128, dtype=torch.float64)
    wave = torch.exp(2j * math.pi * (cycles[0] * line[:, None] + cycles[1] * line))
    seen = BandLimitedDoublePhase(band=0.5, shape=shape).filter(wave, 6.4e-6)[32:96, 32:96].abs().mean()
    assert float(seen) == pytest.approx(passes, abs=0.1)


def test_a_double_phase_hologram_keeps_clear_of_the_wrap_edge(make_bench, scene):
    bench, target = make_bench(pupil=0.8), scene()
    share = {}
    for offset in ("none", "centre"):
        phase = torch.remainder(DoublePhase(offset=offset).solve(target, bench), 2 * math.pi)
        share[offset] = float(((phase < 0.3) | (phase > 2 * math.pi - 0.3)).float().mean())
    assert share["centre"] < 0.05
    assert share["centre"] < share["none"]
