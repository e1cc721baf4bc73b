import math

import pytest
import torch

from holobench_eval.methods.double_phase import AntiAliasedDoublePhase, BandLimitedDoublePhase, DoublePhase, encode
from holobench_eval.optics.convolution import frequencies, iris


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


@pytest.mark.parametrize(("cycles", "passes"), [(0.2, True), (0.3, False)])
def test_the_band_limit_passes_inside_and_stops_outside(cycles, passes):
    columns = torch.arange(128, dtype=torch.float64)[None, :]
    wave = torch.polar(torch.ones(128, 128, dtype=torch.float64), 2 * math.pi * cycles * columns.expand(128, 128))
    seen = BandLimitedDoublePhase(band=0.5).filter(wave, 6.4e-6)[64, 32:96].abs().mean()
    assert float(seen) == pytest.approx(1.0 if passes else 0.0, abs=0.1)


def test_a_square_limit_passes_the_corners_that_a_round_one_stops():
    line = torch.arange(128, dtype=torch.float64)
    wave = torch.polar(torch.ones(128, 128, dtype=torch.float64), 2 * math.pi * 0.2 * (line[:, None] + line))
    middle = (slice(32, 96), slice(32, 96))
    square = BandLimitedDoublePhase(band=0.5, shape="square").filter(wave, 6.4e-6)[middle].abs().mean()
    assert square > 0.9
    assert BandLimitedDoublePhase(band=0.5).filter(wave, 6.4e-6)[middle].abs().mean() < 0.1


def test_a_double_phase_hologram_keeps_clear_of_the_wrap_edge(make_bench, scene):
    bench, target = make_bench(pupil=0.8), scene()
    share = {}
    for offset in ("none", "centre"):
        phase = torch.remainder(DoublePhase(offset=offset).solve(target, bench), 2 * math.pi)
        share[offset] = float(((phase < 0.3) | (phase > 2 * math.pi - 0.3)).float().mean())
    assert share["centre"] < 0.05
    assert share["centre"] < share["none"]
