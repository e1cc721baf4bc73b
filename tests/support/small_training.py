"""Short settings of all methods, a display of a few pixels, its trainings, and a way to kill them at any moment."""

from __future__ import annotations

import atexit
import copy
import io
import math
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from holobench_eval.core import plugins, seeds
from holobench_eval.display import load_profile
from holobench_eval.display.api import Capture, DisplaySpec, Region, white_irradiance
from holobench_eval.display.calibrated import CalibratedBench
from holobench_eval.display.metered import MeteredDisplay
from holobench_eval.display.training import TrainingBench, TrainingImage
from holobench_eval.methods.gerchberg_saxton import GerchbergSaxton
from holobench_eval.methods.sgd import AmplitudeSGD
from holobench_eval.methods.twin.method import OPEN_LOOP
from holobench_eval.methods.wirtinger import Wirtinger

# Few iterations: what rounding does to a phase grows with them, and so does the time. A phase of few iterations leaves
# wide gaps in the histogram that ``with_offset`` takes the emptiest bin of, where rounding would decide.
_EARLY = {"iterations": 5, "offset": "none"}
_START = {"converged": {"iterations": 20, "offset": "none"}, "early": _EARLY}
ROUNDS = {"rounds": 2, "refine_images": 1, "steps": 5, "refine_steps": 3}
_SMALL = {"levels": 2, "width": 4}
_CALIBRATED = {"training": ROUNDS, "search": {"iterations": 2}, "retrieval": {"iterations": 3}, "start": _EARLY}
_HIL = {
    "network": _SMALL,
    "training": ROUNDS,
    # a network of so few steps hides the phase, whose gradient would be rounding
    "retrieval": {"iterations": 0, "perceptual": 0, "ms_ssim": 0},
}
QUICK: dict[str, dict[str, Any]] = {
    "gerchberg_saxton": {"iterations": 6, "initial_phase": "random"},
    "hio": {"iterations": 6},
    **dict.fromkeys(("wirtinger", "sgd", "multi_plane"), _EARLY),
    "odak_sgd": {"iterations": 1},
    "wirtinger_gamma": {"images": 1, "of": _EARLY},
    "wirtinger_veil": {"iterations": 6},
    "nearest_level": {"start": _EARLY},
    **{
        key: {"iterations": 6}
        for key in ("straight_through", "gumbel", "partially_coherent", "random_frames", "light_field", "focal_stack")
    },
    "torchoptics_adam": {"iterations": 6},
    "oracle": {"iterations": 4, "rounds": 2},  # longer descents amplify rounding
    "through": {"iterations": 4, "rounds": 2, "profile": "leto-aged"},
    "online_camera": {"captures": 24, "start": _START},
    "online_camera_network": {"captures": 24, "start": _START, "steps": 3, "network": _SMALL},
    "hil": {**_HIL, "start": _EARLY},
    "hil_tuned": {**_HIL, "offsets": 2, "start": {"offset": "none"}},
    "hil_nh3d": {
        "network": {**_SMALL, "name": "unet"},
        "training": ROUNDS,
        "retrieval": {"iterations": 3, "step": 0.05},
        "start": _EARLY,
    },
    "hil_plus": {"network": _SMALL, **_CALIBRATED},
    "hil_terms": {"network": {**_SMALL, "name": "unet"}, **_CALIBRATED},
    **{
        key: {**_CALIBRATED, "patterns": 2}
        for key in ("parametric_model", "partially_coherent_model", "learned_kernel")
    },
    "twin": {**_CALIBRATED, "patterns": 2, "holograms": 4},
    **{key: {**_CALIBRATED, "patterns": 2, "width": 4} for key in ("cnn_prop_cnn", "hybrid_model")},
    **{
        key: {"training": {"steps": 8}, "retrieval": {"iterations": 3}, "start": _EARLY}
        for key in ("image_terms", "image_network", "field_network")
    },
    **{
        key: {"steps": 3, "width": 4, "offset": "none"}
        for key in ("holonet", "ccnn", "tensor_holography", "unet_phase")
    },
}

# What a twin learns from, where no number hangs on how far holograms have converged.
SHORT_OPEN_LOOP = tuple(
    replace(method, iterations=5) if isinstance(method, (Wirtinger, AmplitudeSGD, GerchbergSaxton)) else method
    for method in OPEN_LOOP
)


def quick(name: str, **other: Any) -> Any:
    """A shipped method with short settings, and others in their place."""
    settings = {"file": str(_fields() / "{target}.npy")} if name == "phases" else QUICK.get(name, {})
    return plugins.build("methods", name, {**settings, **other})


@cache
def _fields() -> Path:
    """A folder with complex fields at the panels of the tests' displays."""
    folder = Path(tempfile.mkdtemp(prefix="fields-"))
    atexit.register(shutil.rmtree, folder)
    for shape in ((3, 48, 56), (2, 64, 64)):
        draw = np.random.default_rng(5).standard_normal((2, *shape))
        np.save(folder / f"{'x'.join(map(str, shape))}.npy", draw[0] + 1j * draw[1])
    return folder


class Killed(BaseException):
    """The process is gone."""


@dataclass
class Fate:
    """Notes the moments that a training passes, and ends it at the one numbered ``at``."""

    at: int | None = None
    passed: list[str] = field(default_factory=list)

    def meets(self, moment: str) -> None:
        self.passed.append(moment)
        if self.at is not None and len(self.passed) == self.at + 1:
            raise Killed(moment)


def small_spec(size: int = 64, region: int = 48, colours: int = 1, **optics: Any) -> DisplaySpec:
    edge = (size - region) // 2
    nominal: dict[str, Any] = {"pitch": 6.4e-6, "distance": 4e-3, "bits": 8, "pupil": None, **optics}
    wavelengths = (636e-9, 517e-9, 446e-9)[:colours]
    return DisplaySpec(
        "small", (size, size), wavelengths=wavelengths, region=Region(edge, edge, region, region), **nominal
    )


def modelled() -> DisplaySpec:
    """The optics of a display that the profile of ``through`` models, on a panel of few pixels."""
    return load_profile(QUICK["through"]["profile"]).spec((128, 128))


def pictures(spec: DisplaySpec, count: int = 1, first: int = 0) -> Tensor:
    """Smooth pictures with a bright edge, ``(count, C, h, w)`` linear light in [0, 1]."""
    draws = [
        torch.rand(len(spec.wavelengths), 6, 6, generator=torch.Generator().manual_seed(100 + first + number))
        for number in range(count)
    ]
    smooth = functional.interpolate(torch.stack(draws), spec.region.shape, mode="bilinear")
    smooth[..., : spec.region.height // 3, : spec.region.width // 3] = 0.9
    return smooth


@dataclass
class BentDisplay:
    """Bends the phase, adds light that it does not modulate, and photographs with a little noise."""

    spec: DisplaySpec
    fate: Fate = field(default_factory=Fate)
    names: tuple[object, ...] = ()

    @property
    def bench(self) -> BentDisplay:
        return self

    def exposure(self, target: Tensor) -> tuple[float, ...]:
        return (1.0,) * len(target)

    def session(self, names: tuple[object, ...], target: Tensor) -> BentDisplay:
        return BentDisplay(self.spec, self.fate, names)

    def announce(self, phases):
        pass

    def capture(self, phase: Tensor) -> Capture:
        self.fate.meets("before a photograph")
        shown = phase.remainder(math.tau)
        frames = []
        for channel, one in enumerate(shown + 0.4 * torch.sin(shown)):
            light = torch.polar(torch.ones_like(one), one) + 0.2
            frames.append(self.spec.region.crop(self.spec.propagator(channel).forward(light)).abs().square())
        frame = torch.stack(frames)
        noise = torch.randn(frame.shape, generator=seeds.generator(*self.names))
        self.fate.meets("after a photograph")
        return Capture(frame + 0.01 * noise, dark=0.0, white=math.inf, gain=(1.0,) * len(frame))

    def rectified(self, capture: Capture, target: Tensor) -> Tensor:
        return capture.linear() / white_irradiance(target, self.spec)[:, None, None]


class Memory:
    """What stays of a training that was killed: values and rows. as_files: the values go through a file's bytes."""

    def __init__(self, as_files: bool = False) -> None:
        self.as_files = as_files
        self.fate = Fate()
        self.kept: dict[str, dict[str, Any]] = {}
        self.rows: list[dict[str, float | int | str]] = []

    def load(self, name: str) -> dict[str, Any] | None:
        return copy.deepcopy(self.kept.get(name))

    def save(self, name: str, value: dict[str, Any]) -> None:
        self.fate.meets(f"before keeping {name}")
        self.kept[name] = through_a_file(value) if self.as_files else copy.deepcopy(value)
        self.fate.meets(f"after keeping {name}")

    def log(self, row: Mapping[str, float | int | str]) -> None:
        """As the memory in a folder: a row takes the place of one of the same round and step."""
        self.fate.meets("before a row")
        place = (row["round"], row["step"])
        self.rows = [*(old for old in self.rows if (old["round"], old["step"]) != place), dict(row)]
        self.fate.meets("after a row")

    @property
    def story(self) -> list[dict[str, float | int | str]]:
        """The rows without the time they took."""
        return [{key: value for key, value in row.items() if key != "seconds"} for row in self.rows]


def through_a_file(value: dict[str, Any]) -> dict[str, Any]:
    buffer = io.BytesIO()
    torch.save(value, buffer)
    buffer.seek(0)
    loaded: dict[str, Any] = torch.load(buffer, weights_only=True)
    return loaded


def training_bench(
    spec: DisplaySpec, memory: Memory, fate: Fate | None = None, images: int = 3, held_out: int = 1, seed: int = 3
) -> TrainingBench:
    """The bench that a training starts on, and starts on again with the same memory after a kill."""
    memory.fate = Fate() if fate is None else fate
    display = cast(CalibratedBench, BentDisplay(spec, memory.fate))
    numbered = pictures(spec, images + held_out)
    given = [TrainingImage(f"picture {number}", picture) for number, picture in enumerate(numbered)]
    return TrainingBench(display, "small", given[:images], given[images:], memory, None, seed)


def solving_bench(method: object, target: Tensor, spec: DisplaySpec, learned: Mapping[str, Any]) -> MeteredDisplay:
    """The bench on which a trained method solves ``target`` ``(C, h, w)``."""
    return MeteredDisplay(cast(Any, BentDisplay(spec)), "small", target, ("solve", 0), method, None, learned)


def same(one: Any, other: Any) -> bool:
    """Whether two learned states are equal, bit for bit."""
    if isinstance(one, Tensor):
        return isinstance(other, Tensor) and torch.equal(one, other)
    if isinstance(one, Mapping):
        return list(one) == list(other) and all(same(one[key], other[key]) for key in one)
    if isinstance(one, list):
        return len(one) == len(other) and all(map(same, one, other))
    return bool(one == other)
