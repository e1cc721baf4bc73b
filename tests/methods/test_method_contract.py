"""What every built-in method promises, whatever its algorithm."""

from typing import Any

import pytest
import torch

from holobench_eval.core import plugins
from holobench_eval.core.errors import UserError

NAMES = [
    "double_phase",
    "double_phase_aa",
    "double_phase_bl",
    "gerchberg_saxton",
    "hio",
    "wirtinger",
    "sgd",
    "oracle",
]
ITERATIVE = NAMES[3:]


def quick(name: str, **params: Any) -> Any:
    short = {"iterations": 6} if name in ITERATIVE else {}
    return plugins.build("methods", name, {**short, **params})


@pytest.mark.parametrize("name", NAMES)
def test_a_phase_has_the_shape_of_the_panel_and_is_finite(name, bench, scene):
    phase = quick(name).solve(scene(batch=2, channels=3), bench)
    assert phase.shape == (2, 3, *bench.spec.shape)
    assert phase.dtype == torch.float32
    assert phase.isfinite().all()
    assert not phase.requires_grad


@pytest.mark.parametrize("name", NAMES)
def test_the_target_is_left_as_it_was(name, bench, scene):
    target = scene(channels=3)
    before = target.clone()
    quick(name).solve(target, bench)
    assert torch.equal(target, before)


@pytest.mark.parametrize("name", NAMES)
def test_the_same_cell_gives_the_same_phase(name, bench, scene):
    target = scene()
    assert torch.equal(quick(name).solve(target, bench), quick(name).solve(target, bench))


@pytest.mark.parametrize(("name", "params"), [*((name, {}) for name in NAMES), ("wirtinger", {"optimiser": "lbfgs"})])
def test_an_image_does_not_depend_on_its_batch(name, params, bench, scene):
    method = quick(name, **params)
    target = scene(batch=2)
    together = method.solve(target, bench)
    apart = torch.cat([method.solve(target[i : i + 1], bench) for i in range(2)])
    difference = torch.remainder(together - apart + torch.pi, 2 * torch.pi) - torch.pi
    assert difference.abs().max() < 1e-3


@pytest.mark.parametrize("name", NAMES)
def test_a_black_channel_gives_a_finite_phase(name, bench, scene):
    target = scene(channels=3)
    target[:, 1] = 0
    assert quick(name).solve(target, bench).isfinite().all()


@pytest.mark.parametrize("name", ["gerchberg_saxton", "hio"])
def test_another_cell_starts_from_another_random_phase(name, bench, scene):
    target = scene()
    here = quick(name).solve(target, bench)
    bench.cell = "another cell"
    assert not torch.allclose(here, quick(name).solve(target, bench), atol=0.1)


@pytest.mark.parametrize("name", ["gerchberg_saxton", "hio", "wirtinger", "sgd"])
def test_iterating_beats_double_phase_where_no_iris_helps_it(name, bench, scene, linear_psnr):
    target = scene(channels=3)
    direct = plugins.build("methods", "double_phase", {}).solve(target, bench)
    iterated = plugins.build("methods", name, {"iterations": 100}).solve(target, bench)
    assert linear_psnr(iterated, target, bench) > linear_psnr(direct, target, bench) + 3


@pytest.mark.parametrize("name", ["wirtinger", "sgd"])
def test_gradient_methods_beat_double_phase_behind_its_iris(name, make_bench, scene, linear_psnr):
    bench, target = make_bench(pupil=0.8), scene(channels=3)
    direct = plugins.build("methods", "double_phase", {}).solve(target, bench)
    iterated = plugins.build("methods", name, {}).solve(target, bench)
    assert linear_psnr(iterated, target, bench) > linear_psnr(direct, target, bench) + 3


@pytest.mark.parametrize("name", NAMES)
def test_only_the_oracle_is_privileged_and_none_has_a_camera(name):
    cls = plugins.find("methods", name)
    assert cls.privileged == (name == "oracle")
    assert not cls.camera


@pytest.mark.parametrize(
    ("name", "params", "words"),
    [
        ("wirtinger", {"iterations": 0}, "'iterations'"),
        ("wirtinger", {"loss": "l3"}, "'loss'"),
        ("wirtinger", {"losses": "huber"}, "did you mean 'loss'"),
        ("wirtinger", {"step": -1}, "'step'"),
        ("wirtinger", {"initial_phase": "noise"}, "'initial_phase'"),
        ("gerchberg_saxton", {"offset": "middle"}, "'offset'"),
        ("hio", {"beta": 3}, "'beta'"),
        ("sgd", {"iterations": "many"}, "'iterations'"),
        ("double_phase", {"quantile": 0}, "'quantile'"),
        ("double_phase_aa", {"sigma": 0}, "'sigma'"),
        ("double_phase_bl", {"band": 2}, "'band'"),
        ("oracle", {"iterations": 1.5}, "'iterations'"),
    ],
)
def test_a_wrong_parameter_is_one_line_that_names_it(name, params, words):
    with pytest.raises(UserError) as caught:
        plugins.build("methods", name, params)
    message = str(caught.value)
    assert words in message
    assert name in message
    assert "\n" not in message
