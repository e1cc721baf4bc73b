"""Make the artifacts that a study's methods need, before its cells are computed."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch

from ..core import plugins
from ..core.device import CPU, find, gpu_name, moved, repeatable
from ..core.errors import CellError, Pending, StopError, reason
from ..core.installed import __version__
from ..core.io import now, write_atomically
from ..core.reads import Seen, recorded
from ..datasets.base import digest_of
from ..display.estimates import joined
from ..display.learned import LearnedBench
from ..display.simulated.ground_truth import truth
from ..display.training import TrainingBench, TrainingImage
from ..display.traits import traits_of
from ..lab.real import RealBench
from . import isolation, opening
from .artifacts import FAILURE, LOG, RECORDS, Artifacts, provenance_of
from .displays import Preparation
from .identity import basis
from .isolation.reads import reads_of
from .phases import Starts, phases_of
from .plan import Plan
from .scoring.job import Setting
from .scoring.reference import guarded
from .versions import AGAIN, HARNESS, dataset_version, gate, method_version

UNKNOWN = RealBench, LearnedBench  # displays without a ground truth
WAITS = "waits for photographs"  # in place of the reason of a failure


@dataclass(frozen=True)
class TrainingJob:
    """A preparation, and the setting of the run that a worker needs to train it."""

    preparation: Preparation
    setting: Setting


def train(job: TrainingJob) -> str:
    """Make an artifact, resuming an earlier attempt. Returns the reason of a failure, empty for success."""
    artifacts, device = Artifacts(job.setting.artifacts), find(job.setting.device)
    with artifacts.locked(job.preparation), repeatable(job.setting.threads, device):
        if artifacts.has(job.preparation):
            return ""
        try:
            _train(job, artifacts, device)
        except StopError:
            raise
        except Pending:
            (artifacts.folder_of(job.preparation) / FAILURE).unlink(missing_ok=True)  # the training goes on
            return WAITS
        except (Exception, SystemExit) as error:
            return artifacts.fail(job.preparation, error)
        return ""


def _train(job: TrainingJob, artifacts: Artifacts, device: torch.device) -> None:
    preparation, setting, study = job.preparation, job.setting, job.setting.study
    limits = replace(study.limits, seconds=math.inf)  # that of time is for cells
    method = isolation.solver(preparation.method, preparation.params, study.folder, study.isolation, limits)
    gate(method, preparation.method, preparation.version, isolation.external(method), preparation.external)
    with recorded() if preparation.images_version else nullcontext(Seen()) as seen:
        dataset, images = _images(preparation, device)
    read = reads_of(dataset, plugins.params_of, seen)
    split = len(images) - preparation.training.held_out
    display_bench = opening.open_display(preparation.display, preparation.seed, device)
    source = {"dataset": preparation.training.dataset, "params": dict(preparation.training.params)}
    source |= {"code": preparation.images_version} if preparation.images_version else {}
    draw, spec = ("training", preparation.seed), preparation.display.spec
    phases = phases_of(setting.output, study.folder, study.part)
    shared = {
        item: Starts(phases, basis({**source, "sha256": sha256}, spec, draw), device, read)
        for item, sha256 in preparation.images
    }
    # Photographs in the folder of a session are found again by each import, and so are no new captures.
    memory = artifacts.memory(preparation)
    journal = None if preparation.display.in_session else memory.journal
    bench = TrainingBench(
        display_bench,
        preparation.method,
        images[:split],
        images[split:],
        memory,
        0 if "blind" in traits_of(method).functions and method.blind() else preparation.training.captures,
        preparation.seed,
        shared,
        journal,
        "none" if preparation.display.in_session else "opened" if preparation.display.real else "kept",
    )
    guard = guarded(preparation.method, study, preparation.display)
    with guard, isolation.opened(method, device) as ready:
        state = method.prepare(bench)
    if not isinstance(state, Mapping):
        raise CellError(f"{preparation.method}: prepare returned {type(state).__name__}, not a mapping of tensors")
    state, reads = moved(state, CPU), read | ready.reads
    outdated, before = artifacts.outdated(preparation), [known for start in shared.values() for known in start.before]
    facts: dict[str, Any] = {
        **({"in_the_place_of": outdated} if outdated else {}),
        "captures": bench.captures if journal is None else journal.captures,
        "seconds": round(bench.seconds + sum(known.cost.seconds for known in before), 1),
        "threads": setting.threads,
        **({"device": f"{device} ({gpu_name(device)})"} if device != CPU else {}),
        "perceptual": state.get("perceptual"),
        "left_out": state.get("left_out"),
        "package": __version__,
        "method_sha256": method_version(type(method)),
        "reads": {**reads.covered},
        **({"uncovered": [*reads.uncovered]} if reads.uncovered else {}),
        "harness_sha256": HARNESS,
        "made": now(),
    }
    artifacts.write(preparation, state, facts | diagnosis(method, state, display_bench))


def diagnosis(method: Any, state: Mapping[str, Any], display_bench: opening.Bench) -> dict[str, Any]:
    """A method's estimates of the display, beside the ground truth; empty without ``estimates`` or ``form``.

    estimates: see ``display.estimates.joined``; missing: texts of the bench's effects that the model's ``form`` has no
    term for; diagnosis_failed: the error, if there was one. A real bench and a network have no ground truth.
    """
    traits = traits_of(method)
    findings: dict[str, Any] = {}
    try:
        if "estimates" in traits.functions:
            true_values = () if isinstance(display_bench, UNKNOWN) else truth(display_bench.bench)
            findings["estimates"] = joined(method.estimates(state, display_bench.spec), true_values)
        if traits.form is not None and not isinstance(display_bench, UNKNOWN):
            findings["missing"] = [
                effect.text for effect in display_bench.bench.profile.effects() if effect.name not in traits.form
            ]
    except Exception as error:  # must not cost what was learned
        findings["diagnosis_failed"] = reason(error)
    return findings


def _images(preparation: Preparation, device: torch.device) -> tuple[Any, list[TrainingImage]]:
    """The dataset, and its training images at the size of the scored region, on a device."""
    given = preparation.training
    dataset = plugins.build("datasets", given.dataset, dict(given.params), preparation.folder)
    spec, images = preparation.display.spec, []
    if dataset_version(given.dataset, type(dataset)) != preparation.images_version:
        raise CellError(f"the code of dataset '{given.dataset}' {AGAIN}")
    for item, sha256 in preparation.images:
        if digest_of(dataset, item) != sha256:
            raise CellError(f"training image '{item}' {AGAIN}")
        target = dataset.load(item, spec.region.shape, channels=len(spec.wavelengths))
        images.append(TrainingImage(item, target.to(device)))
    return dataset, images


def keep_training_records(plan: Plan, artifacts: Artifacts, output: Path) -> None:
    """Copy logs and provenance of what a plan had to learn into ``output/training``.

    Copies stay when their artifact is gone; copies that the plan does not need are removed.
    """
    preparations, names = plan.preparations(), _names(plan)
    folder = output / RECORDS
    for old in (*folder.glob("*.json"), *folder.glob("*.csv")):
        if old.stem not in names.values():
            old.unlink()
    for identity, name in names.items():
        artifact_folder = artifacts.folder_of(preparations[identity])
        provenance = provenance_of(artifact_folder)
        if provenance is not None:
            log = artifact_folder / LOG
            write_atomically(folder / f"{name}.csv", log.read_bytes() if log.is_file() else b"")
            write_atomically(folder / f"{name}.json", f"{json.dumps(provenance, indent=1)}\n".encode())


def _names(plan: Plan) -> dict[str, str]:
    """File names by preparation: the first label that needs it, and the display it is trained on."""
    titles = {
        task.preparation.id: f"{task.label} {task.preparation.display.name}"
        for task in reversed(plan.tasks)
        if task.preparation
    }
    names: dict[str, str] = {}
    for identity, preparation in plan.preparations().items():
        title = titles.get(identity, f"display {preparation.method} {preparation.display.name}")
        stem = re.sub(r"[^A-Za-z0-9._-]+", "-", title).strip("-.")
        taken = {name.lower() for name in names.values()}  # some file systems ignore case
        names[identity] = f"{stem}-{identity[:8]}" if stem.lower() in taken or not stem else stem
    return names
