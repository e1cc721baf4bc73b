import torch

from holobench_eval.methods.sgd import AmplitudeSGD
from holobench_eval.methods.wirtinger import Wirtinger


def test_autograd_and_the_written_out_gradient_take_the_same_path(bench, scene):
    target = scene(dtype=torch.float64)
    shared = {"iterations": 8, "step": 0.1, "initial_phase": "narrow", "offset": "none"}
    by_hand = Wirtinger(loss="amplitude_l2", **shared).solve(target, bench)
    assert torch.allclose(AmplitudeSGD(**shared).solve(target, bench), by_hand, atol=1e-8)
