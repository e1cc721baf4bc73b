"""What is true of a simulated bench, in the quantities of ``estimates``; for reports, never for a method."""

from __future__ import annotations

import cmath
import math

import torch

from ...optics.angular_spectrum import angular_spectrum_phase
from ...optics.convolution import iris
from ...optics.phase import TAU
from ..estimates import MODES, Estimate, disc, estimate, focusing, reach, stray, stroke, undiffracted, zernike_waves
from .maps import enlarged
from .pipeline import SimulatedBench

LEVELS = 17  # gray levels at which the stroke is read, the two at the wrap left out


def truth(bench: SimulatedBench) -> list[Estimate]:
    """Every quantity and colour, from the profile and from the patterns that it drew.

    lut_exponent, phase_gain: those of the profile, today's drift included; of a published table, the nearest law.
    undiffracted: zero order and dead area together, as far as the iris lets them pass.
    light: power from the panel, modulated and unmodulated as far as the iris lets it pass, after dust and laser drift,
    times the mean response of the sensor's pixels.
    stray: share and reach of the stage.
    Zernikes: aberration, and errors of distance and wavelength, over the iris, and the second order of the beam's
    phase as ``estimates.focusing`` has it; none where there is no iris, in a Fourier plane.
    """
    colours = range(len(bench.channels))
    return [item for colour in colours for item in (*_panel_truth(bench, colour), *_optics_truth(bench, colour))]


def _panel_truth(bench: SimulatedBench, colour: int) -> list[Estimate]:
    profile, maps = bench.profile, bench.channels[colour]
    gain = maps.light.lut_gain.double().mean().cpu() * bench.drift_gain
    levels = torch.arange(1, LEVELS - 1, dtype=torch.float64) / (LEVELS - 1)
    law = stroke(levels, profile.lut.phase(levels * 2**profile.panel.bits, profile.panel.bits, gain, colour))
    modulated, unmodulated = complex(maps.light.modulated.mean()), complex(maps.light.unmodulated.mean())
    incident = sum(float(line.light.incident.abs().square().mean()) for line in bench.lines[colour])
    light = (abs(modulated) ** 2 + abs(unmodulated * _passed(bench)) ** 2) * incident
    return [
        estimate("lut_exponent", colour, law.exponent),
        estimate("phase_gain", colour, law.gain),
        estimate("crosstalk", colour, math.sqrt(math.prod(profile.crosstalk.widths(colour)))),
        *undiffracted(unmodulated / modulated * _passed(bench) * cmath.exp(-1j * TAU * law.offset), colour),
        estimate("light", colour, light * float(bench.response.mean()) * _shaded(bench, colour)),
        *stray(*profile.stray_light.veil(colour), colour),
    ]


def _shaded(bench: SimulatedBench, colour: int) -> float:
    """Mean over the region of a shading that was measured."""
    own = bench.profile.sensor.map_of("shading", colour)
    return 1.0 if own is None else float(bench.spec.region.crop(enlarged(own, bench.spec.shape)).mean())


def _passed(bench: SimulatedBench) -> float:
    """Amplitude of unmodulated light behind the iris, which the blaze moves away from it."""
    panel = bench.profile.panel
    fy, fx = (torch.tensor([cycles / panel.pitch], dtype=torch.float64) for cycles in panel.blaze)
    return float(iris(fy, fx, panel.pitch, panel.pupil))


def _optics_truth(bench: SimulatedBench, colour: int) -> list[Estimate]:
    panel, way, geometry = bench.profile.panel, bench.profile.propagation, bench.channels[colour].geometry
    if panel.plane == "fourier":
        return []
    edge = (panel.pupil or 1.0) / (2 * panel.pitch)
    fy, fx = (axis * edge for axis in disc())
    squared, wavelength, distance = fy**2 + fx**2, geometry.wavelength, geometry.distance
    actual = (wavelength * (1 + way.wavelength_error), distance * (1 + way.distance_error))
    phase = way.pupil_phase(fy, fx, geometry, panel.pupil)
    phase = phase + angular_spectrum_phase(squared, *actual) - angular_spectrum_phase(squared, wavelength, distance)
    beam = bench.profile.illumination.wavefront(geometry)
    waves = zernike_waves(phase + focusing(beam, reach(wavelength, distance, panel.pitch, panel.pupil)))
    return [estimate(name, colour, waves[name]) for name in MODES]
