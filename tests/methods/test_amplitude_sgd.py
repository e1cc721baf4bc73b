import torch

from holobench_eval.methods.common import nominal_model, per_channel, unit_field
from holobench_eval.methods.descent import adam, by_autograd
from holobench_eval.methods.initial_phase import initial_phase
from holobench_eval.methods.losses import amplitude_l2
from holobench_eval.methods.sgd import AmplitudeSGD


def test_autograd_and_the_written_out_gradient_take_the_same_path(bench, scene):
    def by_graph(image, channel):
        model, region = nominal_model(bench, channel, image), bench.spec.region

        def loss(phase):
            return amplitude_l2(region.crop(model.forward(unit_field(phase))).abs().square(), image)

        return adam(initial_phase("narrow", image, bench, channel), by_autograd(loss), iterations=8, step=0.1)

    target = scene(dtype=torch.float64)
    found = AmplitudeSGD(iterations=8, step=0.1, initial_phase="narrow", offset="none").solve(target, bench)
    assert torch.allclose(found, per_channel(target, by_graph), atol=1e-8)
