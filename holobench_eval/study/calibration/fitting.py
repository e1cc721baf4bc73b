"""The fit of a profile's free parameters to published figures; what other methods then score is a prediction."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from statistics import fmean
from tempfile import TemporaryDirectory

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import least_squares
from torch import Tensor

from ...core import plugins
from ...core.errors import UserError
from ...core.io import write_png
from ...display import Profile
from ...display.simulated.pipeline import SimulatedBench
from ...metrics import match, score
from ...optics import srgb_encode
from ..config import load_study
from ..executors import Serial
from ..opening import open_bench
from ..plan import plan
from ..running.progress import Lines
from ..running.run import run
from . import Calibration, hologram, nested, with_values

Values = Mapping[str, float]

EVALUATIONS = 10  # of the figures, at most, beside those for slopes
STEP = 0.03  # for slopes, in units of a parameter's range and its place in it
TRAININGS, NEAR = 4, 0.25  # of the network, at most; error of its figure [dB] that is small enough


@dataclass(frozen=True)
class Fitting:
    """The fit of one profile.

    source: its name or its file; watch: of trainings; tell: called with a line a trial.
    """

    source: str
    profile: Profile
    calibration: Calibration
    watch: Lines
    tell: Callable[[str], object]

    def fit(self) -> tuple[dict[str, float], float | None]:
        """Values of all free parameters, three digits after the point, and the PSNR [dB] of the network with them.

        Of the trials whose figures are within the tolerance, that of the nearest prediction; if none is, that of the
        nearest figures.
        """
        wanted = self.calibration.prediction
        if wanted is None:
            return self._fit_figures({}), None
        low, high = self.calibration.free[wanted.parameter]
        # Of each trial: value, error of the prediction, largest error of a figure [dB], all values.
        trials: list[tuple[float, float, float, dict[str, float]]] = []
        value = attrgetter(wanted.parameter)(self.profile)
        for _ in range(TRAININGS):
            value = float(np.clip(value, low, high))
            values = self._fit_figures({wanted.parameter: round(value, 3)})
            error = self.predicted(values) - wanted.psnr
            self.tell(f"{_listed(values)}: network {error + wanted.psnr:.2f} dB")
            trials.append((value, error, max(map(abs, self._missed(values).values())), values))
            if abs(error) < NEAR or (value == high if error < 0 else value == low):
                break
            if len(trials) == 1:
                value += (high - low) / 10 * (1 if error < 0 else -1)
            else:
                (a, at_a, *_), (b, at_b, *_) = sorted(trials, key=lambda trial: abs(trial[1]))[:2]
                value = b if at_a == at_b else a - at_a * (b - a) / (at_b - at_a)
        allowed = max(wanted.tolerance, min(off for _, _, off, _ in trials))
        able = [(error, values) for _, error, off, values in trials if off <= allowed]
        error, values = min(able, key=lambda trial: abs(trial[0]))
        return values, wanted.psnr + error

    def captured(self, values: Values) -> dict[str, float]:
        """Mean PSNR [dB] of real captures of each method, registered, with these values."""
        bench = open_bench(with_values(self.profile, values), self.calibration.panel, self.calibration.seed)

        def psnr(phase: Tensor, item: str) -> float:
            image = bench.photograph(phase, self._targets[item], item, 0).image
            return score(image, self._targets[item], metrics=("psnr",))["psnr_linear"]

        return self._means(psnr)

    def predicted(self, values: Values) -> float:
        """Mean PSNR [dB] of the network's predictions of captures with these values."""
        wanted = self.calibration.prediction
        assert wanted is not None
        is_file = self.source.endswith((".yaml", ".yml"))
        candidate = {"like": str(Path(self.source).resolve()) if is_file else self.source, **nested(values)}
        with TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "targets").mkdir()
            for item, target in self._targets.items():  # as pictures, since no study scores images for training
                write_png(folder / "targets" / f"{item}.png", (255 * srgb_encode(target)).round(), 8)
            document = {
                "display": {"profiles": ["candidate.yaml"], "panel": list(self.calibration.panel)},
                "targets": {"dataset": "folder", "params": {"path": str(folder / "targets")}},
                **wanted.study,
            }
            for file, content in (("candidate.yaml", candidate), ("study.yaml", document)):
                (folder / file).write_text(json.dumps(content), encoding="utf-8")  # which YAML takes as well
            study = load_study(folder / "study.yaml")
            threads = torch.get_num_threads()
            outcome = run(study, plan(study), folder / "output", Serial(), self.watch, threads, folder / "artifacts")
        records = [record for record in outcome.records if record["label"] == study.labels[0]]
        for record in records:
            if record["state"] != "done":
                raise UserError(f"the network's study failed: {record['reason']}")
        return fmean(record["scores"]["psnr_linear"] for record in records)

    def _fit_figures(self, fixed: Values) -> dict[str, float]:
        """Values of all free parameters that bring the captures nearest to their figures, some of them fixed."""
        ranges = {name: ends for name, ends in self.calibration.free.items() if name not in fixed}
        low, high = np.array(list(ranges.values())).T

        def values(places: NDArray[np.float64]) -> dict[str, float]:
            found = (low + (places - 1) * (high - low)).tolist()
            return {name: round(value, 3) for name, value in zip(ranges, found, strict=True)} | dict(fixed)

        def errors(places: NDArray[np.float64]) -> list[float]:
            missed, figures = self._missed(values(places)), self.calibration.figures
            told = (f"{name} {figures[name] + miss:.2f} dB" for name, miss in missed.items())
            self.tell(f"{_listed(values(places))}: {', '.join(told)}")
            return list(missed.values())

        own = [attrgetter(name)(self.profile) for name in ranges]
        start, steps = np.clip(1 + (own - low) / (high - low), 1.05, 1.95), [STEP] * len(own)
        found = least_squares(errors, start, bounds=(1.0, 2.0), diff_step=steps, xtol=1e-2, max_nfev=EVALUATIONS)
        return values(found.x)

    def _missed(self, values: Values) -> dict[str, float]:
        """By how much each figure is missed [dB] with these values, in quick pictures."""
        psnr = self._quick(values)
        return {name: psnr[name] - published for name, published in self.calibration.figures.items()}

    def _quick(self, values: Values) -> dict[str, float]:
        """Mean PSNR [dB] of each method without camera and registration, for the search."""
        bench = SimulatedBench(with_values(self.profile, values).scaled(self.calibration.panel))

        def psnr(phase: Tensor, item: str) -> float:
            target = self._targets[item]
            image = match(bench.spec.region.crop(bench.image(phase)), target)[0]
            return float(-10 * torch.log10((image - target).square().mean()))

        with torch.no_grad():
            return self._means(psnr)

    def _means(self, psnr: Callable[[Tensor, str], float]) -> dict[str, float]:
        """The mean over the images of a figure of a phase and its image, by method."""
        solved = self._holograms.items()
        return {name: fmean(psnr(phase, item) for item, phase in phases.items()) for name, phases in solved}

    @cached_property
    def _targets(self) -> dict[str, Tensor]:
        given, shape = self.calibration.targets, self.profile.spec(self.calibration.panel).region.shape
        dataset = plugins.build("datasets", given.dataset, dict(given.params))
        return {item: dataset.load(item, shape) for item in dataset.items()}

    @cached_property
    def _holograms(self) -> dict[str, dict[str, Tensor]]:
        """Phases by method and image, solved once: no method knows the parameters that are fitted."""
        bench = open_bench(self.profile, self.calibration.panel, self.calibration.seed)
        return {
            name: {item: hologram(name, bench, target, item) for item, target in self._targets.items()}
            for name in self.calibration.figures
        }


def _listed(values: Values) -> str:
    return ", ".join(f"{name} {value:.3f}" for name, value in values.items())
