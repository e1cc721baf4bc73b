"""The twin of a display, learned from captures: a calibrated method, and by ``to_profile`` a display."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, ClassVar, cast

import torch
from annotated_types import Interval

from ...display.api import DisplaySpec
from ...display.estimates import Estimate
from ...display.training import TrainingBench
from ..calibrated.approximator import ModelApproximator, Rates
from ..calibrated.display_model import FORM
from ..calibrated.method import ShortSchedule, ThroughModel
from ..calibrated.patterns import dark_samples, pattern_samples
from ..double_phase import DoublePhase
from ..gerchberg_saxton import GerchbergSaxton
from ..learned.samples import Sample, Steps, captured, together
from ..learned.weights import refuse_other_weights
from ..sgd import AmplitudeSGD
from ..wirtinger import Wirtinger
from .drift import TwinApproximator
from .errors import estimates, unseen
from .model import TwinCamera, TwinModel

OPEN_LOOP = (Wirtinger(), DoublePhase(), AmplitudeSGD(), GerchbergSaxton(initial_phase="random"))


def learned_twin(learned: Mapping[str, Any], spec: DisplaySpec) -> tuple[TwinModel, TwinCamera]:
    """Model and camera as `Twin` has learned them. UserError for what another method has learned."""
    twin = TwinModel(spec), TwinCamera(spec)
    with refuse_other_weights():
        for module, name in zip(twin, ("model", "terms"), strict=True):
            module.load_state_dict(learned[name])
    return twin


@dataclass(frozen=True)
class TwinSchedule(ShortSchedule):
    """First what other methods make, then what the twin itself makes, whose errors it has to know, until that no longer
    helps: on `leto-2020` and `leto-dusty` twice the steps and twice the captures gained 0.0 to 0.2 dB.

    Parameters
    ----------
    gain : float
        Of the prediction of held-out captures [dB]: a round that gains less is the last, before all `rounds` are done.
    """

    rounds: Annotated[int, Interval(ge=1, le=100)] = 4
    images: Annotated[int, Interval(ge=1)] | None = 8
    refine_images: Annotated[int, Interval(ge=1)] | None = 4
    steps: Steps = 600
    refine_steps: Steps = 300
    gain: Annotated[float, Interval(ge=0, le=100)] = 0.1

    def ends(self, watched: Sequence[float]) -> bool:
        """See the base."""
        return len(watched) > 1 and watched[-1] - watched[-2] < self.gain


@dataclass(frozen=True)
class Twin(ThroughModel):
    """A physical model with the levels, the sub-samples and the camera of the display, learned from captures.

    It learns from patterns that visit every level and frequency, from dark ones that tell haze from tone, from
    holograms of four methods, which a lab will compare on it, and from its own. SI units throughout.

    Parameters
    ----------
    patterns : int
        Speckle-like patterns.
    holograms : int
        Holograms of training images, by Wirtinger holography, double phase, descent on
        amplitude and Gerchberg-Saxton in turn.
    """

    training: TwinSchedule = TwinSchedule()
    patterns: Annotated[int, Interval(ge=0, le=1000)] = 12
    holograms: Annotated[int, Interval(ge=0, le=10_000)] = 12

    title: ClassVar[str] = "a twin of the display"
    RATES: ClassVar[Rates] = Rates(model=3e-2, terms=1e-2)
    version: ClassVar[int] = 4
    form: ClassVar[frozenset[str]] = FORM | {
        *("trefoil_y", "trefoil_x", "quantisation", "sub_pixel_field", "pose", "sensor_area", "blur", "response"),
        *("vignetting", "sensor_response", "shading", "panel_dust", "roughness", "fringes"),
    }

    def approximator(self, spec: DisplaySpec) -> TwinApproximator:
        """A display that is as the nominal model says, but for a little crosstalk."""
        return TwinApproximator(spec, self.RATES)

    def prepare(self, bench: TrainingBench) -> Mapping[str, Any]:
        """See the base; ``halves``, what it learns of either half of the captures, and ``unseen`` are for errors."""
        learned = super().prepare(bench)
        earlier, dark = self._earlier(bench), dark_samples(bench)
        model, camera = learned_twin(learned, bench.spec)
        halves = [
            bench.kept(f"half {number}", partial(self._refined, bench, learned, [*earlier[number::2], *dark], number))
            for number in (0, 1)
        ]
        hidden = unseen(model.to(bench.device), camera.to(bench.device), [*earlier, *dark])
        return {**learned, "halves": halves, "unseen": hidden}

    def _refined(
        self, bench: TrainingBench, learned: Mapping[str, Any], samples: Sequence[Sample], number: int
    ) -> dict[str, Any]:
        """What a twin learns that goes on from what it has learned with these samples alone."""
        again, steps = self.approximator(bench.spec).to(bench.device), self.training.refine_steps
        again.load_learned(learned)
        draw, passes = bench.generator("half", number), -(-steps // len(samples))
        order = torch.cat([torch.randperm(len(samples), generator=draw) for _ in range(passes)]).tolist()
        for step in range(steps):
            again.step(samples[order[step]], step / steps)
        return again.learned()

    def estimates(self, learned: Mapping[str, Any], spec: DisplaySpec) -> list[Estimate]:
        """What it says of the display ``spec``, with errors."""
        return estimates(learned, spec)

    def _samples(self, approximator: ModelApproximator, bench: TrainingBench) -> Sequence[Sample]:
        samples, first = super()._samples(approximator, bench), 0 if self.patterns else 1
        again = [pattern_samples(bench, 1, number)[0] for number in range(first, 3)]
        cast(TwinApproximator, approximator).steadied(again)
        return samples

    def _earlier(self, bench: TrainingBench) -> Sequence[Sample]:
        again = [partial(pattern_samples, bench, 1, number) for number in (1, 2)]
        patterns = partial(pattern_samples, bench, self.patterns)
        return together(patterns, again[0], partial(self._holograms, bench), again[1])

    def _holograms(self, bench: TrainingBench) -> Sequence[Sample]:
        numbers = range(self.holograms)
        images = [bench.images[number % len(bench.images)] for number in numbers]
        methods = [OPEN_LOOP[number % len(OPEN_LOOP)] for number in numbers]
        phases = [bench.solved(method, image) for method, image in zip(methods, images, strict=True)]
        return list(captured(bench, [f"hologram {number}" for number in numbers], phases, images, "hologram"))
