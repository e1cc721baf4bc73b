"""Lines of a source and stray light add in intensity; a blaze turns each line by its grating equation."""

from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter
from torch import Tensor

from holobench_eval.display import Profile
from holobench_eval.display.simulated.geometry import Geometry
from holobench_eval.display.simulated.ground_truth import truth
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.stages import AddedLens, Illumination, LookUpTable, Spectrum, StrayLight
from holobench_eval.display.simulated.stages.stray_light import gaussian
from holobench_eval.optics.angular_spectrum import AngularSpectrum

BLAZE, DISTANCE = (0.0, 0.25), 0.06


def measured(*lines: tuple[float, float]) -> Spectrum:
    return Spectrum(measured=(lines,) * 3)


def blazed(profile: Profile, spectrum: Spectrum, **stages: object) -> SimulatedBench:
    panel = replace(profile.panel, blaze=BLAZE, distance=DISTANCE)
    return SimulatedBench(replace(profile, panel=panel, spectrum=spectrum, **stages))


def centre(light: Tensor) -> float:
    """Column of the centroid of an image."""
    return float((light.sum(0) * torch.arange(light.shape[1])).sum() / light.sum())


def test_a_line_has_its_width_and_all_its_power(geometry: Geometry) -> None:
    lines = Spectrum(width=(3e-9, 2e-9, 1e-9), lines=5).spectrum(geometry)
    assert sum(share for share, _ in lines) == pytest.approx(1)
    variance = sum(share * (line.wavelength - geometry.wavelength) ** 2 for share, line in lines)
    assert variance**0.5 * 2.3548 == pytest.approx(2e-9, rel=1e-4)  # green
    assert lines[0][1].wavelength == pytest.approx(geometry.wavelength, abs=1e-15)
    # a measured spectrum is taken as it is
    lines = measured((1e-9, 3.0), (0.0, 1.0)).spectrum(geometry)
    assert [(share, round(1e9 * line.detuning, 6)) for share, line in lines] == [(0.25, 0.0), (0.75, 1.0)]


def test_a_blazed_beam_of_another_wavelength_lands_where_full_propagation_puts_it(ideal: Profile) -> None:
    offset, beam = 5e-9, Illumination(beam_sigma=0.15)
    nominal, long = (
        blazed(ideal, measured((d, 1.0)), illumination=beam).intensity(torch.zeros(ideal.panel.shape), 1)
        for d in (0.0, offset)
    )
    # independently: the same beam with its carrier, on a panel that is large enough, without any re-centring
    rows, columns, wavelength = 96, 768, ideal.panel.wavelengths[1]
    y, x = torch.arange(rows)[:, None] - 47.5, torch.arange(columns) - 383.5
    carried = torch.exp(-(y**2 + x**2) / (2 * (0.15 * 96) ** 2)) * torch.exp(2j * torch.pi * BLAZE[1] * x)
    seen = [
        AngularSpectrum((rows, columns), ideal.panel.pitch, wavelength + d, DISTANCE).forward(carried).abs().square()
        for d in (0.0, offset)
    ]
    moved = centre(seen[1]) - centre(seen[0])
    assert moved == pytest.approx(DISTANCE * offset * BLAZE[1] / ideal.panel.pitch**2, rel=0.01)
    assert centre(long) - centre(nominal) == pytest.approx(moved, rel=0.02)


def test_without_a_blaze_a_narrow_line_changes_almost_nothing(ideal: Profile, phase: Tensor) -> None:
    narrow = replace(ideal, spectrum=Spectrum(width=(1e-9,) * 3))
    single, broad = (SimulatedBench(profile).intensity(phase[1], 1) for profile in (ideal, narrow))
    assert 0 < float((broad - single).norm() / single.norm()) < 0.02


def test_a_wavelength_that_the_blaze_turns_by_three_pixels_gives_almost_the_same_speckle_there(ideal: Profile) -> None:
    phase = 6 * torch.rand(ideal.panel.shape, generator=torch.Generator().manual_seed(1))
    pixels = 3 * ideal.panel.pitch**2 / (DISTANCE * BLAZE[1])
    nominal, long = (blazed(ideal, measured((d, 1.0))).intensity(phase, 1) for d in (0.0, pixels))

    def alike(columns: int) -> float:
        return float(torch.corrcoef(torch.stack([long, nominal.roll(columns, 1)])[..., 8:-8].flatten(1))[0, 1])

    assert max(range(-6, 7), key=alike) == 3
    assert alike(3) > alike(0) + 0.1


def test_the_stroke_falls_with_the_wavelength_and_all_lines_meet_the_same_lens(geometry: Geometry) -> None:
    ((_, long),) = measured((0.1 * geometry.wavelength, 1.0)).spectrum(geometry)
    assert torch.allclose(LookUpTable().gain_map(long), torch.tensor(1 / 1.1))
    lens = AddedLens(move=(0.1, 0.1, 0.0))
    assert torch.allclose(lens.hologram(long), lens.hologram(geometry), rtol=1e-6)


def test_the_effect_is_listed_with_its_width_and_what_the_blaze_makes_of_it(ideal: Profile) -> None:
    assert "spectrum" not in {effect.name for effect in ideal.effects()}
    panel = replace(ideal.panel, blaze=(0.0, 0.25), distance=0.1, pitch=6.4e-6)
    listed = replace(ideal, panel=panel, spectrum=measured((-1e-9, 1.0), (1e-9, 1.0))).effects()
    text = next(effect.text for effect in listed if effect.name == "spectrum")
    assert "1/1/1 nm" in text
    assert f"{1e-9 * 0.1 * 0.25 / 6.4e-6**2:.2g} px" in text


def test_the_light_that_the_ground_truth_states_is_that_of_all_lines(ideal: Profile) -> None:
    def light(spectrum: Spectrum) -> list[float]:
        bench = SimulatedBench(replace(ideal, spectrum=spectrum))
        return [estimate.value for estimate in truth(bench) if estimate.name == "light"]

    assert light(Spectrum(width=(2e-9,) * 3, lines=5)) == pytest.approx(light(Spectrum()), rel=1e-6)


@settings(max_examples=20, deadline=None)
@given(st.floats(1, 80), st.integers(5, 90), st.integers(5, 90))
def test_the_veil_is_a_gaussian(spread: float, rows: int, columns: int) -> None:
    light = torch.rand(rows, columns, generator=torch.Generator().manual_seed(1))
    expected = torch.from_numpy(gaussian_filter(light.double().numpy(), spread, mode="constant", truncate=8)).float()
    assert torch.allclose(gaussian(light, spread), expected, atol=3e-4 * float(expected.max()))


def test_a_fine_checkerboard_keeps_the_stated_contrast(ideal: Profile, geometry: Geometry) -> None:
    y, x = torch.meshgrid(torch.arange(512), torch.arange(512), indexing="ij")
    board = ((y // 8 + x // 8) % 2).float()
    seen = StrayLight(share=0.4, reach=0.1).image(board, ideal, geometry)[200:312, 200:312]
    inner = board[200:312, 200:312] == 1
    assert float(seen[inner].mean() / seen[~inner].mean()) == pytest.approx(0.8 / 0.2, rel=0.01)


def test_the_power_stays_but_for_what_leaves_the_image(ideal: Profile, geometry: Geometry) -> None:
    light = torch.zeros(200, 200)
    light[90:110, 90:110] = 1
    assert float(StrayLight(0.5, 0.05).image(light, ideal, geometry).sum()) == pytest.approx(400, rel=1e-3)
    assert float(StrayLight(0.5, 1.0).image(light, ideal, geometry).sum()) < 250
    light = torch.zeros(21, 21)
    light[10, 10] = 1  # and a veil that is narrower than a sample
    assert float(StrayLight(1.0, 0.01).image(light, ideal, geometry).sum()) == pytest.approx(1, rel=1e-3)


def test_two_images_add_with_their_veils(ideal: Profile, geometry: Geometry) -> None:
    a, b = torch.rand(2, 64, 96, generator=torch.Generator().manual_seed(1))
    stage = StrayLight(0.3, 0.2)
    apart = stage.image(a, ideal, geometry) + stage.image(b, ideal, geometry)
    assert torch.allclose(stage.image(a + b, ideal, geometry), apart, atol=1e-6)


def test_the_veil_does_not_depend_on_the_samples_a_pixel(ideal: Profile, geometry: Geometry) -> None:
    coarse = torch.rand(24, 32, generator=torch.Generator().manual_seed(1))
    fine = coarse.repeat_interleave(4, 0).repeat_interleave(4, 1)
    stage = StrayLight(1.0, 0.2)
    seen = stage.image(fine, ideal, geometry).view(24, 4, 32, 4).mean((1, 3))
    assert torch.allclose(seen, stage.image(coarse, ideal, geometry), rtol=0.01)


def test_the_gradient_is_that_of_the_veil(ideal: Profile, geometry: Geometry) -> None:
    light = torch.rand(8, 12, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda image: StrayLight(0.4, 0.2).image(image, ideal, geometry), light)


def test_it_acts_on_the_light_and_is_listed(ideal: Profile, phase: Tensor) -> None:
    veiled = replace(ideal, stray_light=StrayLight(0.5, 0.3))
    clear, dim = (SimulatedBench(profile).integrated(phase[1], 1) for profile in (ideal, veiled))
    assert torch.allclose(dim, 0.5 * clear + 0.5 * gaussian(clear, 0.3 * clear.shape[0]), atol=1e-5)
    assert "50 %" in next(effect.text for effect in veiled.effects() if effect.name == "stray_light")
    assert "stray_light" not in {effect.name for effect in ideal.effects()}


def test_any_number_of_threads_gives_the_same_veil() -> None:
    light = torch.rand(540, 960, generator=torch.Generator().manual_seed(1))
    once = gaussian(light, 5.4)
    for threads in (2, 3):
        torch.set_num_threads(threads)
        again = gaussian(light, 5.4)
        torch.set_num_threads(1)
        assert torch.equal(once, again)
