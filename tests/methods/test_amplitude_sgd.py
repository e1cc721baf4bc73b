import torch

from holobench_eval.methods.losses import amplitude_l2
from holobench_eval.methods.sgd import AmplitudeSGD
from holobench_eval.methods.wirtinger import Wirtinger


def ideal_loss(phase, target, bench):
    model = bench.spec.propagator(0, dtype=torch.complex128)
    field = model.forward(torch.polar(torch.ones_like(phase), phase))
    return float(amplitude_l2(bench.spec.region.crop(field).abs().square(), target))


def test_autograd_and_the_written_out_gradient_take_the_same_path(bench, scene):
    target = scene(dtype=torch.float64)
    shared = {"iterations": 8, "step": 0.1, "initial_phase": "narrow", "offset": "none"}
    by_hand = Wirtinger(loss="amplitude_l2", **shared).solve(target, bench)
    assert torch.allclose(AmplitudeSGD(**shared).solve(target, bench), by_hand, atol=1e-8)


def test_descent_lowers_the_amplitude_loss(bench, scene):
    target = scene(dtype=torch.float64)
    losses = [ideal_loss(AmplitudeSGD(iterations=n).solve(target, bench)[:, 0], target[:, 0], bench) for n in (1, 25)]
    assert losses[1] < 0.3 * losses[0]


def test_the_best_phase_survives_a_step_that_is_too_large(bench, scene):
    target = scene(dtype=torch.float64)
    losses = [
        ideal_loss(AmplitudeSGD(iterations=n, step=3.0).solve(target, bench)[:, 0], target[:, 0], bench)
        for n in (1, 4, 8, 16)
    ]
    assert losses == sorted(losses, reverse=True)
