"""What a learned display model says about its display: numbers with units, free of the model's gauge freedoms."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from typing import Any, ClassVar

import torch
from torch import Tensor

from ...display.api import DisplaySpec
from ...display.estimates import Estimate, disc, estimate, focusing, reach, stray, stroke, undiffracted, zernike_waves
from ...optics.phase import TAU
from ...optics.phasor import squared_modulus
from ...optics.zernike import NAMES, zernike
from .display_model import FORM, KNOTS, DisplayModel, enlarged


def is_blocked(spec: DisplaySpec) -> bool:
    """Whether the blaze moves unmodulated light away from the iris."""
    return math.hypot(*spec.blaze) > (spec.pupil or math.inf) / 2


class Diagnosed:
    """A trained method whose state ``model`` is that of a ``DisplayModel``, and ``terms`` that of a ``Haze``."""

    form: ClassVar[frozenset[str]] = FORM

    def estimates(self, learned: Mapping[str, Any], spec: DisplaySpec) -> list[Estimate]:
        """What the model that was learned says of the display ``spec``."""
        model = DisplayModel(spec)
        model.load_state_dict(dict(learned["model"]))
        return [*diagnose(model), *haze(learned["terms"])]


@torch.no_grad()
def diagnose(model: DisplayModel) -> list[Estimate]:
    """The quantities of ``display.estimates`` in a model.

    Learned from images, the model leaves these open, and so the estimates do not depend on them:

    - slope of the table against gain, gain map against its mean: the driven phase is read, table times mean gain, at
      the knots between the two at the wrap, which are seen through crosstalk alone;
    - a constant in the table, in the angle of the beam and in the undiffracted light: the constant that the law of
      the stroke leaves is taken off the phase of the undiffracted light;
    - mean amplitude of the beam against brightness: their product is the light;
    - curvature of the beam against defocus and astigmatism: they are added (``display.estimates.focusing``).
    """
    return [
        value
        for colour in range(len(model.spec.wavelengths))
        for value in (*_panel_estimates(model, colour), *_optics_estimates(model, colour))
    ]


def haze(state: Mapping[str, Tensor]) -> list[Estimate]:
    """Share and reach of the haze in the state of a ``Haze``."""
    pairs = zip(state["share"].sigmoid().tolist(), state["reach"].exp().tolist(), strict=True)
    return [value for colour, (share, reach) in enumerate(pairs) for value in stray(share, reach, colour)]


def _panel_estimates(model: DisplayModel, colour: int) -> list[Estimate]:
    levels = torch.arange(1, KNOTS - 1, dtype=torch.float64) / (KNOTS - 1)
    gain = torch.exp(enlarged(model.gain, model.spec.shape)[colour]).double().mean()
    law = stroke(levels, (TAU * levels + model.table[colour, 1:-1]) * gain)
    ratio = complex(*model.undiffracted[colour].tolist())
    beam = squared_modulus(model.illumination()[colour]).mean()
    passed = 0.0 if is_blocked(model.spec) else 1.0
    light = float(beam * torch.exp(model.brightness[colour])) * (1 + passed * abs(ratio) ** 2)
    turned = ratio * cmath.exp(-1j * TAU * law.offset)
    return [
        estimate("lut_exponent", colour, law.exponent),
        estimate("phase_gain", colour, law.gain),
        estimate("crosstalk", colour, float(torch.exp(model.crosstalk[colour]))),
        *undiffracted(turned, colour),
        estimate("light", colour, light),
    ]


def _optics_estimates(model: DisplayModel, colour: int) -> list[Estimate]:
    spec, (y, x) = model.spec, disc()
    modes = torch.stack([zernike(NAMES[name], y, x) for name in model.MODES])
    lens = focusing(
        enlarged(model.angle, spec.shape)[colour],
        reach(spec.wavelengths[colour], spec.distance, spec.pitch, spec.pupil),
    )
    waves = zernike_waves(model.aberration[colour].double() @ modes + lens)
    return [estimate(name, colour, waves[name]) for name in model.MODES]
