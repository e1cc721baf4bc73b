"""Patterns: holograms whose captures tell what no natural image tells.

Speckle-like ones are holograms of nothing, and tell what a panel does to a phase.

Natural holograms are smooth and their images mostly follow from the ideal model. A random phase visits every level of
the look-up table in every neighbourhood, and its speckle carries every spatial frequency, so that a dozen captures
tell look-up table, phase gain, crosstalk, unmodulated light and aberrations apart.

Dark ones are lit for a part only. Haze lights what no hologram lights, and there alone differs from tone.
"""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor
from torch.nn import functional

from ...display.training import TrainingBench, TrainingImage
from ..learned.samples import Sample, captured
from ..wirtinger import Wirtinger

# Correlation lengths [px] that the patterns go through in turn: wraps from everywhere to a few long edges.
LENGTHS = (2.0, 4.0, 8.0, 16.0)
# Of the constant picture that the camera is exposed for; speckle peaks stay below its saturation.
GRAY = 0.25


def pattern_samples(bench: TrainingBench, count: int, again: int = 0) -> list[Sample]:
    """``count`` patterns, captured, one capture each. again: of the same patterns before, whose noise is another."""
    spec, numbers = bench.spec, range(count)
    gray = torch.full((len(spec.wavelengths), *spec.region.shape), GRAY, device=bench.device)
    images = [TrainingImage(f"pattern-{number:02d}", gray) for number in numbers]
    lengths = [LENGTHS[number % len(LENGTHS)] for number in numbers]
    draws = [bench.generator("pattern", number) for number in numbers]
    phases = [
        random_phase(len(spec.wavelengths), spec.shape, length, draw).to(bench.device)
        for length, draw in zip(lengths, draws, strict=True)
    ]
    names, told = (("pattern", again), f" again {again}") if again else (("pattern",), "")
    return list(captured(bench, [f"pattern {number}{told}" for number in numbers], phases, images, *names))


def dark_samples(bench: TrainingBench) -> list[Sample]:
    """Wirtinger holograms of the `dark_patterns`, one capture each."""
    white = torch.ones(len(bench.spec.wavelengths), *bench.spec.region.shape, device=bench.device)
    images = [TrainingImage(name, white * light) for name, light in dark_patterns(white[0]).items()]
    phases = [bench.solved(Wirtinger(), image) for image in images]
    grays = [TrainingImage(image.item, white * image.target.mean()) for image in images]  # of the same light
    shots = captured(bench, [f"dark {image.item}" for image in images], phases, grays, "dark")
    return [replace(sample, target=image.target) for sample, image in zip(shots, images, strict=True)]


def dark_patterns(like: Tensor) -> dict[str, Tensor]:
    """Linear light ``(h, w)`` of three patterns that are dark for the most part, on the device of ``like``."""
    height, width = like.shape
    y, x = torch.meshgrid(torch.arange(height) / height, torch.arange(width) / width, indexing="ij")
    square = (y - 0.5).abs().maximum((x - 0.5).abs()) < 0.2
    lit = {"left half": x < 0.5, "upper half": y < 0.5, "square": square}
    return {name: pattern.to(like) for name, pattern in lit.items()}


def random_phase(colours: int, shape: tuple[int, int], length: float, draw: torch.Generator) -> Tensor:
    """Phase ``(colours, *shape)`` [rad] in (-pi, pi] of circular Gaussian noise behind a Gaussian filter.

    length: the filter's standard deviation [px]. Every value is equally likely, and the phase has vortices, as fully
    developed speckle has (Goodman, Speckle Phenomena in Optics, section 4.8).
    """
    reach = int(3 * length)
    size = (shape[0] + 2 * reach, shape[1] + 2 * reach)
    noise = torch.randn((2 * colours, 1, *size), generator=draw)
    taps = torch.exp(-(torch.arange(-reach, reach + 1) / length).square() / 2)
    smooth = functional.conv2d(functional.conv2d(noise, taps.view(1, 1, -1, 1)), taps.view(1, 1, 1, -1))
    return torch.atan2(smooth[:colours, 0], smooth[colours:, 0])
