"""What every method promises, as one check that its tests call."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import FrozenInstanceError, fields, is_dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import torch
from torch import Tensor

from ..core.errors import UserError
from ..core.hashing import canonical
from ..core.plugins import params_of
from ..core.seeds import generator
from ..display import CalibratedBench, MeteredDisplay, load_profile
from ..display.phases import from_numpy, is_plain, type_name
from ..display.training import TrainingBench, TrainingImage
from ..display.traits import traits_of
from ..study.artifacts import FolderMemory
from ..study.opening import open_bench
from ..study.versions import method_version

PLAIN_PANEL, CAMERA_PANEL = (64, 64), (128, 128)
"""A display that is photographed needs a region large enough to register its camera."""


def check_method(method: Any) -> None:
    """Check a method, given as a class (then with its default parameters) or as an instance.

    AssertionError, with a sentence on what is wrong, unless it is a frozen dataclass with plain parameters, turns
    intensity ``(B, C, h, w)`` into a finite phase ``(B, C, H, W)``, or frames ``(B, F, C, H, W)``, for one and several
    images and for one and three
    colours (for three alone if it has a camera), gives the same phase for the same seed, leaves its target alone, and
    captures only with ``camera = True``. One that learns is prepared first, with three smooth images.
    """
    cls = method if isinstance(method, type) else type(method)
    assert is_dataclass(cls), f"{cls.__name__} is not a dataclass; write @dataclass(frozen=True) above it"
    instance = _default(cls) if isinstance(method, type) else method
    _check_parameters(cls, instance)
    try:
        traits = traits_of(cls)
    except UserError as error:
        raise AssertionError(str(error)) from error
    photographs = traits.camera or traits.trains
    bench = open_bench(load_profile("ideal"), CAMERA_PANEL if photographs else PLAIN_PANEL, seed=0)
    learned = _learned(instance, bench) if traits.trains else None
    fewest = 3 if photographs else 1  # a capture is of all colours of the display
    _check_solution(instance, bench, _target(bench, images=1, channels=3), learned)
    _check_solution(instance, bench, _target(bench, images=2, channels=fewest), learned)
    again = [_solve(instance, bench, _target(bench, images=2, channels=fewest), learned)[0] for _ in range(2)]
    assert torch.equal(*again), f"{cls.__name__}.solve is not repeatable; draw from bench.generator(...)"


def _default(cls: type[Any]) -> Any:
    try:
        return cls()
    except TypeError as error:
        raise AssertionError(f"{cls.__name__} needs a default for every parameter: {error}") from error


def _check_parameters(cls: type[Any], instance: Any) -> None:
    name = cls.__name__
    for item in fields(cls):
        try:
            setattr(instance, item.name, getattr(instance, item.name))
        except FrozenInstanceError:
            continue
        raise AssertionError(f"{name} can be changed after it was made; write @dataclass(frozen=True)")
    for flag in ("camera", "privileged"):
        assert flag not in {item.name for item in fields(cls)}, f"{name}.{flag} must be a ClassVar, not a parameter"
    canonical(params_of(instance))
    assert method_version(cls) == method_version(cls), f"the code of {name} cannot be identified"
    assert callable(getattr(instance, "solve", None)), f"{name} has no method 'solve'"
    assert replace(instance) == instance, f"{name} is not equal to its own copy; remove eq=False"


def _target(bench: CalibratedBench, images: int, channels: int) -> Tensor:
    """Smooth blobs and an edge: what a picture has, in the region's size."""
    height, width = bench.spec.region.shape
    noise = torch.rand((images, channels, 6, 6), generator=generator("contract", images, channels))
    target = torch.nn.functional.interpolate(noise, (height, width), mode="bilinear")
    target[..., : height // 3, : width // 3] = 0.9
    return target.clamp(0, 1)


def _learned(method: Any, bench: CalibratedBench) -> Mapping[str, Any]:
    name = type(method).__name__
    assert callable(getattr(method, "prepare", None)), f"{name} declares trains = True, but has no method 'prepare'"
    targets = _target(bench, images=3, channels=3)
    images = [TrainingImage(f"image {number}", target) for number, target in enumerate(targets)]
    with TemporaryDirectory() as folder:
        memory = FolderMemory(Path(folder))
        learned = method.prepare(TrainingBench(bench, name, images[:2], images[2:], memory, None, seed=0))
    assert isinstance(learned, Mapping), f"{name}.prepare returned {type_name(learned)}, not a mapping of tensors"
    return learned


def _check_solution(method: Any, bench: CalibratedBench, target: Tensor, learned: Mapping[str, Any] | None) -> None:
    name, before = type(method).__name__, target.clone()
    shape = (*target.shape[:2], *bench.spec.shape)
    phase, handle = _solve(method, bench, target, learned)
    assert is_plain(phase), (
        f"{name}.solve returned {type_name(phase)}, not a plain torch.Tensor or a NumPy array of float32 or float64"
    )
    assert phase.ndim in (4, 5), f"{name}.solve returned {tuple(phase.shape)} for {shape}"
    assert (len(phase), *phase.shape[-3:]) == shape, f"{name}.solve returned {tuple(phase.shape)} for {shape}"
    assert phase.is_floating_point(), f"{name}.solve returned {phase.dtype}, not a phase in radians"
    assert bool(phase.isfinite().all()), f"{name}.solve returned a phase with NaN or infinite values"
    assert torch.equal(target, before), f"{name}.solve changed its target; clone it first"
    declared = traits_of(method).camera or handle.captures == 0
    assert declared, f"{name} captures, but declares no camera; set camera = True"


def _solve(
    method: Any, bench: CalibratedBench, target: Tensor, learned: Mapping[str, Any] | None
) -> tuple[Any, MeteredDisplay]:
    name = type(method).__name__
    handle = bench.for_method(method, name, target[0], item="contract", repeat=0, learned=learned)
    torch.seed()  # another one at every call: it shows up a method that draws from the global generator
    return from_numpy(method.solve(target, handle)), handle
