"""A bench with a lens shows the Fourier transform of its panel, and says what has no meaning there."""

from dataclasses import replace

import pytest
import torch

from holobench_eval.core.device import CPU
from holobench_eval.core.errors import UserError
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.changes import altered
from holobench_eval.display.simulated.fourier_path import FourierPath
from holobench_eval.display.simulated.geometry import Geometry
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.stages import Propagation, Spectrum
from holobench_eval.optics import Fresnel

SHAPE = (64, 80)
COLOURS = (6.36e-7, 5.17e-7, 4.46e-7)


def bench(wavelengths=COLOURS, **stages):
    """An ideal display with a lens."""
    ideal = load_profile("ideal")
    lens = {"plane": "fourier", "pupil": None, "bits": 16, "region": 0.4, "region_offset": (0.25, 0.2)}
    panel = replace(ideal.panel, wavelengths=wavelengths, **lens)
    return SimulatedBench(replace(ideal, panel=panel, **stages).scaled(SHAPE))


def smooth(seed=0):
    """A phase [rad] of some waves, whose light stays near the zero order."""
    draw = torch.Generator().manual_seed(seed)
    coarse = 3 * torch.randn(1, 1, 5, 6, generator=draw)
    return torch.nn.functional.interpolate(coarse, size=SHAPE, mode="bicubic")[0, 0]


def off(one, other):
    return float((one - other).norm() / other.norm())


def nominal(spec, phase, channel):
    return spec.propagator(channel).forward(torch.polar(torch.ones_like(phase), phase))


@pytest.mark.parametrize("channel", [0, 1, 2])
@pytest.mark.parametrize("sampling", [1, 3])
def test_an_ideal_bench_shows_what_methods_are_told(channel, sampling):
    shown = bench(sampling=sampling)
    light = shown.intensity(smooth(), channel)[:: shown.image_samples, :: shown.image_samples]
    assert off(light, nominal(shown.spec, smooth(), channel).abs().square()) < 2e-3


def test_the_adjoint_passes_the_dot_product_test_and_is_the_gradient():
    torch.manual_seed(0)
    geometry = Geometry((7, 10), 8e-6, 532e-9, 0.2, 3, 0, ("test",), image_pitch=1e-3)
    path = FourierPath(geometry, Propagation(wavelength_error=0.01), 2, CPU, torch.complex128)
    field = torch.randn(3, 3, 7, 10, dtype=torch.complex128).requires_grad_()
    light = torch.randn(14, 20, dtype=torch.complex128)
    assert torch.allclose((light.conj() * path.forward(field)).sum(), (path.adjoint(light).conj() * field).sum())
    (grad,) = torch.autograd.grad((path.forward(field) * light.conj()).real.sum(), field)
    assert torch.allclose(grad, path.adjoint(light))


@pytest.mark.parametrize("share", [0.02, -0.03])
def test_an_error_of_the_distance_is_free_space_behind_the_focal_plane(share):
    shown = bench((5.17e-7,), propagation=Propagation(distance_error=share))
    spec, phase = shown.spec, smooth()
    focus = nominal(spec, phase, 0)
    there, back = (
        Fresnel(SHAPE, spec.image_pitch, spec.wavelengths[0], way, padding=200).forward(focus).abs().square()
        for way in (share * spec.distance, -share * spec.distance)
    )
    assert off(shown.intensity(phase, 0), there) < 0.04  # of which is lost what the grid does not hold
    assert off(shown.intensity(phase, 0), back) > 0.3


def test_another_wavelength_is_a_picture_of_another_size():
    shown = bench((5.0e-7,), propagation=Propagation(wavelength_error=0.25))
    ramp = 2 * torch.pi * 8 / 80 * torch.arange(80.0).expand(SHAPE)
    assert divmod(int(shown.intensity(ramp, 0).argmax()), 80) == (32, 40 + 10)


def test_lines_of_a_spectrum_add_up_at_their_sizes():
    shown = bench((5.0e-7,), spectrum=Spectrum(measured=(((0.0, 1.0), (5e-8, 1.0)),)))
    ramp = 2 * torch.pi * 20 / 80 * torch.arange(80.0).expand(SHAPE)
    row = shown.intensity(ramp, 0)[32]
    assert sorted(row.topk(2).indices.tolist()) == [40 + 20, 40 + 22]


def test_an_aberration_spreads_a_spot_and_keeps_its_light():
    flat = torch.zeros(SHAPE)
    stages = (Propagation(aberration={"coma_x": waves}) for waves in (0, 0.2))
    spot, spread = (bench((5e-7,), propagation=stage).intensity(flat, 0) for stage in stages)
    assert float(spread.max()) < 0.5 * float(spot.max())
    assert float(spread.sum()) == pytest.approx(float(spot.sum()), rel=0.01)


def test_region_and_camera_lie_beside_the_zero_order():
    shown = SimulatedBench(load_profile("pluto-fourier").scaled((256, 256)))
    region = shown.spec.region
    assert min(region.top, region.left) > 128 + 8
    image = shown.image(torch.zeros(1, 256, 256))[None]
    bright = torch.nn.functional.grid_sample(image, shown.grid[None], align_corners=True)
    assert float(bright.mean()) < 0.1  # of light that is 1 on average


FRESNEL = "3:.* is for an image in a Fresnel plane"


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ("panel:\n  blaze: [0.0, 0.25]", "4:.*by region_offset, not blaze"),
        ("panel:\n  region_offset: [0.0, 0.4]", "4:.*up to 0.3125 to each side"),
        ("propagation: {obstruction: 0.1}", FRESNEL),
        ("propagation: {pupil_shift: [0.1, 0.0]}", FRESNEL),
        ("coherent_noise: {plane_specks: 4}", FRESNEL),
        ("lens: {move: [0.1, 0.1, 0.0]}", FRESNEL),
        ("eye: {focus: [0.1, 0.1, 0.0]}", FRESNEL),
    ],
)
def test_what_does_not_go_with_a_lens_is_refused(tmp_path, changes, fault):
    (tmp_path / "mine.yaml").write_text(f"like: pluto-fourier\nname: mine\n{changes}\n")
    with pytest.raises(UserError, match=rf"mine\.yaml:{fault}"):
        load_profile("mine.yaml", tmp_path)


def test_changes_of_focus_are_refused_and_others_made():
    profile = load_profile("pluto-fourier")
    for kind, value in (("refocus", 5.0), ("obstruction", 0.2), ("camera_shift_x", 10.0)):
        with pytest.raises(UserError, match=f"{kind} does not suit 'pluto-fourier': .* Fresnel plane"):
            altered(profile, kind, value)
    assert altered(profile, "distance", 1.0).propagation.distance_error == pytest.approx(0.0105)
