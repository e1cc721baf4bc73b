"""Gerchberg-Saxton and HIO; phase retrieval in the Fourier plane of a lens, and who refuses it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import torch

from holobench_eval.core.errors import UserError
from holobench_eval.display import Region, load_profile
from holobench_eval.interactive import open_display
from holobench_eval.methods.common import matched, nominal_model
from holobench_eval.methods.gerchberg_saxton import GerchbergSaxton, as_bright, step
from holobench_eval.methods.hio import HybridInputOutput
from holobench_eval.methods.initial_phase import initial_phase
from holobench_eval.methods.sgd import AmplitudeSGD
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.study.config import load_study
from holobench_eval.study.identity import basis

FEW, RANDOM = GerchbergSaxton(iterations=30), GerchbergSaxton(iterations=30, initial_phase="random")


@pytest.mark.parametrize(
    ("pupil", "start"), [(None, "random"), (None, "constant"), (0.6, "random"), (0.6, "constant"), ("lens", "random")]
)
def test_the_error_never_rises(pupil, start, make_bench, lens, scene):
    bench = lens if pupil == "lens" else make_bench(pupil=pupil)
    target = scene(bench.spec.region.width, dtype=torch.float64)[:, 0]
    model, region = nominal_model(bench, 0, target), bench.spec.region
    phase = initial_phase(start, target, bench, 0)
    amplitude = as_bright(target, phase, model, region)
    errors = []
    for _ in range(40):
        phase, error = step(phase, amplitude, model, region)
        errors.append(float(error))
    assert all(after <= before * (1 + 1e-12) for before, after in pairwise(errors))
    assert errors[-1] < 0.5 * errors[0]


def test_the_target_gets_the_light_that_the_start_sends_into_the_region_and_an_exact_hologram_stays(bench, scene):
    target = scene(dtype=torch.float64)[:, 0]
    model, region = nominal_model(bench, 0, target), bench.spec.region
    phase = initial_phase("random", target, bench, 0)
    amplitude = as_bright(target, phase, model, region)
    exact = region.crop(model.forward(torch.polar(torch.ones_like(phase), phase))).abs()
    assert amplitude.square().sum() == pytest.approx(float(exact.square().sum()))
    assert torch.allclose(amplitude.square() / target.clamp_min(1e-9), (amplitude.square() / target)[:, :1, :1])
    after, error = step(phase, exact, model, region)
    assert float(error) < 1e-20
    assert torch.allclose(torch.remainder(after - phase + 1, 2 * torch.pi), torch.ones_like(phase))


def test_the_default_start_is_the_better_one(make_bench, scene, linear_psnr):
    bench = make_bench(pupil=0.6)
    target = scene(bench.spec.region.width)
    smooth, rough = (linear_psnr(method.solve(target, bench), target, bench) for method in (FEW, RANDOM))
    assert smooth > rough + 3


def test_hio_converges_further_than_gerchberg_saxton(bench, scene, linear_psnr):
    target = scene()
    plain = linear_psnr(GerchbergSaxton(iterations=60).solve(target, bench), target, bench)
    assert linear_psnr(HybridInputOutput(iterations=60).solve(target, bench), target, bench) > plain + 1


def test_hio_returns_the_best_phase_that_it_saw(bench, scene, linear_psnr):
    """At beta = 2 the iteration oscillates; its returned error falls all the same as it runs on."""
    target = scene()[:, 0].double()
    model, region = nominal_model(bench, 0, target), bench.spec.region
    start = initial_phase("random", target, bench, 0)
    amplitude = as_bright(target, start, model, region)
    errors = []
    for iterations in (1, 2, 5, 10, 20, 30):
        phase = HybridInputOutput(iterations=iterations, beta=2, offset="none").solve(target[:, None], bench)[:, 0]
        errors.append(float(step(phase, amplitude, model, region)[1]))
    assert errors == sorted(errors, reverse=True)


SIDE = 24


@pytest.fixture
def lens(make_bench):
    """Three colours, a picture of 24 x 24 pixels beside the zero order of 64 x 72."""
    bench = make_bench()
    return replace(bench, spec=replace(bench.spec, plane="fourier", distance=0.2, region=Region(36, 42, SIDE, SIDE)))


def light(phase, bench, channel):
    """The nominal picture of ``(B, H, W)``, the zero order in it."""
    return nominal_model(bench, channel, phase).forward(torch.polar(torch.ones_like(phase), phase)).abs().square()


def error(phase, target, bench, channel):
    """Mean squared error in the region."""
    return float((matched(bench.spec.region.crop(light(phase, bench, channel)), target) - target).square().mean())


@pytest.mark.parametrize("method", [GerchbergSaxton(iterations=30), Wirtinger(iterations=60), AmplitudeSGD(60)])
@pytest.mark.parametrize("colours", [1, 3])
def test_retrieval_leaves_a_fourth_of_the_error_of_its_start_in_every_colour(method, colours, lens, scene):
    bench = replace(lens, spec=replace(lens.spec, wavelengths=lens.spec.wavelengths[:colours]))
    target = scene(SIDE, channels=colours)
    phase = method.solve(target, bench)
    for channel, wanted in enumerate(target.unbind(1)):
        starts = (initial_phase(kind, wanted, bench, channel) for kind in ("random", "constant"))
        begun = min(error(start, wanted, bench, channel) for start in starts)
        assert error(phase[:, channel], wanted, bench, channel) < begun / 4


@pytest.mark.parametrize("kind", ["constant", "narrow", "quadratic"])
def test_a_smooth_start_lights_the_region_and_not_the_zero_order(kind, lens, scene):
    target = scene(SIDE)[:, 0]
    phase = initial_phase(kind, target, lens, 1)
    seen = light(phase, lens, 1)
    assert float(lens.spec.region.crop(seen).sum()) > 0.5 * phase.numel()
    assert float(seen[0, 32, 36]) < 0.05 * phase.numel()
    with pytest.raises(UserError, match="'initial_phase: dpe' needs the image in a Fresnel plane"):
        initial_phase("dpe", target, lens, 1)


def config(folder, methods="wirtinger", display="pluto-fourier", dataset="photographs", measure="picture"):
    text = f"""title: "a lens"
display: {{profiles: [{display}], panel: [256, 256]}}
targets: {{dataset: {dataset}}}
methods: [{methods}]
measure: {measure}
"""
    (folder / "study.yaml").write_text(text)
    return load_study(folder / "study.yaml")


@pytest.mark.parametrize("method", ["double_phase", "multi_plane", "parametric_model", "learned_kernel", "hil_plus"])
def test_a_study_of_a_method_that_needs_a_fresnel_plane_is_refused(method, tmp_path):
    with pytest.raises(UserError, match=f"yaml:4:11: method '{method}' needs the image in a Fresnel plane; 'pluto-f"):
        config(tmp_path, method)
    assert config(tmp_path, method, display="pluto-offaxis").labels


@pytest.mark.parametrize(("dataset", "measure"), [("focal_stacks", "focus"), ("light_fields", "views")])
def test_planes_and_views_of_scenes_are_refused(dataset, measure, tmp_path):
    with pytest.raises(UserError, match=f"measure: {measure} needs a Fresnel plane"):
        config(tmp_path, dataset=dataset, measure=measure)


def test_optics_without_a_lens_are_described_as_before():
    told = basis({}, load_profile("leto-aged").spec(), ())["optics"]
    assert told == basis({}, replace(load_profile("leto-aged").spec(), plane="fresnel"), ())["optics"]
    assert "plane" not in told
    assert basis({}, load_profile("pluto-fourier").spec(), ())["optics"]["plane"] == "fourier"


def test_the_camera_is_registered_beside_the_zero_order_and_sees_the_picture(scene):
    display = open_display("pluto-fourier", panel=(256, 256))
    target = display.target(scene(96)[0, 0].numpy())
    solved, wanted = display.solve("wirtinger", target, iterations=40), torch.tensor(np.asarray(target))
    seen, dark = (torch.tensor(np.asarray(display.capture(phase, target))) for phase in (solved, 0 * solved))
    assert float(torch.corrcoef(torch.stack([seen.flatten(), wanted.flatten()]))[0, 1]) > 0.75
    assert float(dark.mean()) < 0.01 * float(seen.mean())  # of a flat phase, all light is in the zero order
    with pytest.raises(UserError, match="'double_phase' needs the image in a Fresnel plane"):
        display.solve("double_phase", target)
