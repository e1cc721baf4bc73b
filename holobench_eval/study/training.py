"""Make the artifacts that a study's methods need, before its cells are computed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from .. import __version__
from ..core import plugins
from ..core.device import CPU, find, gpu_name, moved
from ..core.errors import CellError, LostDeviceError, Pending
from ..display.calibrated import CalibratedBench
from ..display.estimates import joined
from ..display.simulated.ground_truth import truth
from ..display.training import TrainingBench, TrainingImage
from ..lab.real import RealBench
from .artifacts import Artifacts
from .displays import workbench
from .job import repeatable
from .preparation import Preparation
from .provenance import now
from .versions import HARNESS, method_version

WAITS = "waits for photographs"
"""In the place of a reason why a training failed."""


@dataclass(frozen=True)
class TrainingJob:
    """A preparation and what a worker needs to carry it out. device: name of where it computes, see ``device.find``."""

    needed: Preparation
    folder: Path
    threads: int
    device: str = "cpu"


def train(job: TrainingJob) -> str:
    """Make an artifact, going on where an earlier attempt stopped. Returns why it failed, empty if it did not."""
    artifacts, device = Artifacts(job.folder), find(job.device)
    with artifacts.locked(job.needed), repeatable(job.threads, device):
        if artifacts.has(job.needed):
            return ""
        try:
            _train(job.needed, artifacts, job.threads, device)
        except LostDeviceError:
            raise
        except Pending:
            artifacts.forget_failure(job.needed)
            return WAITS
        except (Exception, SystemExit) as error:
            return artifacts.fail(job.needed, error)
        return ""


def _train(needed: Preparation, artifacts: Artifacts, threads: int, device: torch.device) -> None:
    method = plugins.build("methods", needed.method, dict(needed.params), needed.folder)
    images = _images(needed, device)
    split = len(images) - needed.held_out
    place = workbench(needed.place, needed.seed, device)
    bench = TrainingBench(
        place,
        needed.method,
        images[:split],
        images[split:],
        artifacts.memory(needed),
        needed.captures,
        needed.seed,
    )
    state = method.prepare(bench)
    if not isinstance(state, Mapping):
        raise CellError(f"{needed.method}: prepare returned {type(state).__name__}, not a mapping of tensors")
    state = moved(state, CPU)
    facts: dict[str, Any] = {
        "captures": bench.captures,
        "seconds": round(bench.seconds, 1),
        "threads": threads,
        **({"device": f"{device} ({gpu_name(device)})"} if device != CPU else {}),
        "perceptual": state.get("perceptual"),
        "package": __version__,
        "method_sha256": method_version(type(method)),
        "harness_sha256": HARNESS,
        "made": now(),
    }
    artifacts.write(needed, state, facts | diagnosis(method, state, place))


def diagnosis(method: object, state: Mapping[str, Any], place: CalibratedBench | RealBench) -> dict[str, Any]:
    """What a method says of the display it learned, beside the truth, for methods that say something.

    estimates: see ``display.estimates.joined``; missing: effects of the bench that the form of the method's model has
    no term for, each in words, if the method says what its ``form`` is; diagnosis_failed: why there is neither.
    Of a real bench the truth is not known.
    """
    estimates, form = getattr(method, "estimates", None), getattr(method, "form", None)
    found: dict[str, Any] = {}
    try:
        if estimates is not None:
            known = () if isinstance(place, RealBench) else truth(place.bench)
            found["estimates"] = joined(estimates(state, place.spec), known)
        if form is not None and not isinstance(place, RealBench):
            found["missing"] = [one.text for one in place.bench.profile.effects() if one.name not in form]
    except Exception as error:  # must not cost what was learned
        found["diagnosis_failed"] = " ".join(f"{type(error).__name__}: {error}".split())[:300]
    return found


def _images(needed: Preparation, device: torch.device) -> list[TrainingImage]:
    """The training images at the size of the scored region, on a device."""
    dataset = plugins.build("datasets", needed.dataset, dict(needed.dataset_params), needed.folder)
    spec, images = needed.place.spec, []
    for item, sha256 in needed.images:
        if dataset.digest(item) != sha256:
            raise CellError(f"training image '{item}' has changed since the study was planned; start the run again")
        target = dataset.load(item, spec.region.shape, channels=len(spec.wavelengths))
        images.append(TrainingImage(item, target.to(device)))
    return images
