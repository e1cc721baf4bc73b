"""A small case of everything whose version is declared, and the numbers that it gave: ``outputs.json``.

``python -m tests.golden.outputs`` adds what the file lacks, replaces what has a new version, and refuses the rest.
"""

import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from holobench_eval.core import plugins, seeds
from holobench_eval.core.sources import declared_version
from holobench_eval.display import DisplaySpec, load_profile
from holobench_eval.display.api import Capture
from holobench_eval.display.nominal import ideal_light
from holobench_eval.display.simulated import profile as profiles
from holobench_eval.imaging.align import align
from holobench_eval.methods.predictors.veil import veiled
from holobench_eval.methods.simulated import through
from holobench_eval.methods.twin import method as twin
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics import catalogue, control, match, score
from holobench_eval.metrics.protocol import VERSION as PROTOCOL
from holobench_eval.study.opening import open_bench
from holobench_eval.study.scoring.changed import changed_target, moved_phase
from holobench_eval.study.versions import ALIGNMENT, HARNESS
from tests.support import photographed
from tests.support import small_training as small
from tests.support.toy_camera import ToyDisplay, picture

FILE = Path(__file__).with_name("outputs.json")
REWRITE = "`python -m tests.golden.outputs`"
PROJECTIONS = 6

# Relative to a tensor's size. `python -m tests.processors tests/golden` tells what other processors take of it: less
# than a third, by what a case is made of, since no tolerance is wide enough for a descent that rounding decides.
EXACT, ITERATED = 1e-4, 2e-3
# Beside ``small_training.QUICK``: what keeps rounding small, or a step of one percent large.
SETTINGS: dict[str, dict[str, Any]] = {
    # The emptiest bin of a constant phase is one of many without a pixel.
    "partially_coherent": {"initial_phase": "random"},
    # Converged, a phase has pixels without a slope, and Adam's step there has the sign of rounding. See ``_short``.
    "hil_tuned": {"start": small.QUICK["hil"]["start"]},
    "through": {"iterations": 2, "rounds": 1},
    # An absolute error has the slope of its pixels' signs, and rounding decided one of them in the eighth step. Four
    # steps are few enough for rounding to stay small, with a pattern first and a random start: the coma of a symmetric
    # picture has no slope, and a constant start leaves phases about zero, where they wrap.
    "hybrid_model": {
        "training": {**small.ROUNDS, "steps": 2, "refine_steps": 2},
        "patterns": 3,  # so many that one of them comes first
        "start": {"iterations": 5, "offset": "none", "initial_phase": "random"},
        "width": 6,
    },
    "field_network": {"retrieval": {"iterations": 0}},
    "straight_through": {"iterations": 4},
    # Second steps divide by slopes of first ones that are rounding; rates make up for one step in the place of three.
    "ccnn": {"steps": 1},
    "holonet": {"steps": 1, "width": 8, "rate": 4e-3},
    "tensor_holography": {"rate": 2e-2},
    "odak_sgd": {"iterations": 3},  # a tolerance of 5 % had hidden a change of one
}
# Judged by the picture that nominal optics make of the phase, in means over so many pixels. A constant phase, which a
# bias of a network gives, makes no difference to a picture, so that Adam's steps on it are those of rounding. A pixel
# whose slope vanishes goes the way of rounding, to the next level, too: of one in thousands a mean tells nothing.
PICTURES = {"holonet": 1, "tensor_holography": 1, "ccnn": 4, "straight_through": 4, "gumbel": 4, "through": 8}
# The panel of two levels shows fiducial holograms of which rounding decides single pixels: its registration is a
# two-hundredth of a pixel off, and so is what is seen through it.
PICTURES |= {"flc-1bit": 16}
# What they learned is judged by what it shows: where the first slope of a weight is zero, its second step is rounding.
WITHOUT_WEIGHTS = {*PICTURES, "field_network"}
# The picture of the first changes by little in a step, the network of the second by little in a few.
TOLERANCES = {"holonet": EXACT, "hybrid_model": EXACT}
LARGER = {"leto-hazy-c": (160, 160), "pluto-fourier": (256, 256)}  # panels of profiles not registered at 128 px

Numbers = dict[str, list[float]]


@dataclass(frozen=True)
class Case:
    """What is computed, in tensors by name, under which version, and how far it may lie off on another CPU."""

    version: str
    compute: Callable[[], Mapping[str, Tensor]]
    tolerance: float = ITERATED

    def numbers(self) -> Numbers:
        """Summaries of the tensors."""
        with _one_thread(), _no_weights(), torch.random.fork_rng(devices=[]):
            return {name: summary(values) for name, values in self.compute().items()}


def summary(values: Tensor) -> list[float]:
    """Mean, standard deviation and random projections of a tensor, all of the size of its values.

    A projection is a sum weighted by normal numbers over the square root of their count: a change of all values by a
    share of their size changes it by about that share, and rounding by nothing that counts.
    """
    flat = values.detach().double().flatten()
    if len(flat) == 1:
        return flat.tolist()
    draw = seeds.generator("golden", len(flat))
    weights = torch.randn(PROJECTIONS, len(flat), generator=draw, dtype=torch.float64)
    numbers = torch.cat([torch.stack([flat.mean(), flat.std()]), weights @ flat / len(flat) ** 0.5])
    return [float(f"{number:.9g}") for number in numbers.tolist()]


def share(case: Case, numbers: list[float], recorded: list[float]) -> float:
    """How far the numbers of a tensor lie from the recorded ones, as a share of what rounding explains."""
    size = max(abs(value) for value in recorded[:2])  # mean and deviation, or the number itself
    off = np.abs(np.subtract(numbers, recorded)).max()
    return float(off / (case.tolerance * max(size, 1e-6))) if np.isfinite(off) else np.inf


def differences(case: Case, numbers: Numbers, recorded: Numbers) -> list[str]:
    """The names of the tensors whose numbers lie further from the recorded ones than rounding explains."""
    if numbers.keys() != recorded.keys():
        return sorted(numbers.keys() ^ recorded.keys())
    return [name for name in numbers if share(case, numbers[name], recorded[name]) > 1]


def complaint(name: str, case: Case, numbers: Numbers, recorded: Mapping[str, Any] | None) -> str | None:
    """What is wrong with a case, and what to do about it; None where its numbers are those of its version."""
    if recorded is None:
        return f"'{name}' is not in {FILE.name}: {REWRITE} adds it"
    if recorded["version"] != case.version:
        return f"'{name}' has a new version, and {FILE.name} the numbers of the old one: {REWRITE} rewrites it"
    changed = differences(case, numbers, recorded["numbers"])
    if not changed:
        return None
    declared = {
        "method": "`version` of the method's class",
        "metric": "`version` of the `Metric`",
        "profile": "`version` in the profile's YAML, or HARNESS where the bench is another",
        "alignment": "ALIGNMENT",
        "control": "VERSION in holobench_eval/metrics/control.py",
        "protocol": "VERSION in holobench_eval/metrics/protocol.py, or HARNESS",
    }[name.split()[0]]
    return (
        f"numbers of '{name}' changed ({', '.join(changed)}): raise its declared version ({declared}; see "
        f"holobench_eval/study/versions.py), then {REWRITE} rewrites {FILE.name}; or undo the change"
    )


def recorded() -> dict[str, Any]:
    """What the file holds."""
    return dict(json.loads(FILE.read_text(encoding="utf-8"))) if FILE.is_file() else {}


def cases() -> dict[str, Case]:
    """All that can be computed here; methods whose package is not installed are left out."""
    folder = Path(profiles.__file__).with_name("profiles")
    shipped = sorted(path.stem for path in folder.glob("*.yaml"))
    methods = {name: plugins.find("methods", name) for name in plugins.names("methods")}
    known = {
        f"profile {name}": Case(_with_harness(load_profile(name).version), partial(_profile, name)) for name in shipped
    }
    known["protocol"] = Case(_with_harness(PROTOCOL), partial(_scores, None), EXACT)
    for metric in catalogue():
        if not metric.name.startswith("lpips"):  # its weights are in no package
            known[f"metric {metric.name}"] = Case(_with_harness(metric.version), partial(_scores, metric.name), EXACT)
    known["control"] = Case(_with_harness(control.VERSION), _control, EXACT)
    known["alignment"] = Case(ALIGNMENT, _alignment)
    for name, cls in methods.items():
        if _installed(cls):
            known[f"method {name}"] = Case(
                declared_version(cls), partial(_method, name), TOLERANCES.get(name, ITERATED)
            )
    return known


def _with_harness(version: object) -> str:
    """The version of what has one of its own beside that of the harness."""
    return f"{version} of {HARNESS}"


def _installed(cls: type[Any]) -> bool:
    return getattr(cls, "available", lambda _: None)(cls()) is None


def _profile(name: str) -> dict[str, Tensor]:
    """A panel of 128 px with its registration: what its camera counts, and what is scored."""
    bench = open_bench(load_profile(name), LARGER.get(name, (128, 128)), seed=3)
    channels = len(bench.spec.wavelengths)
    target = _smooth(channels, bench.spec.region.shape, 0.0, 1.0)
    phase = _smooth(channels, bench.spec.shape, -9.0, 9.0)
    equal = bench.photograph(phase, target, "golden", 0)
    matched = bench.photograph(phase, target, "golden", 1, exposure="matched")
    mean, variance = bench.simulation.expected(phase, target)
    where = [torch.tensor(warp.corners()) for warp in bench.registration.warps]
    pictures = {
        "rectified": equal.image,
        "rectified at matched exposure": matched.image,
        "expected": mean,
        "variance": variance,
    }
    return {
        "sensor": equal.capture.frame,
        **{key: functional.avg_pool2d(picture, PICTURES.get(name, 1)) for key, picture in pictures.items()},
        "registered corners": torch.stack(where),
        "efficiency": torch.tensor(equal.efficiency),
    }


def _scores(metric: str | None) -> dict[str, Tensor]:
    """A picture of 192 px, speckled, shifted by a part of a pixel and noisy, against itself.

    metric: None for the numbers of the protocol that are no metric's.
    """
    target = _smooth(3, (192, 192), 0.0, 1.0).double()
    target[:, 40:90, 50:120] = 0.7
    grain = torch.rand(target.shape, generator=seeds.generator("golden", "speckle"), dtype=torch.float64)
    capture = 0.6 * target.roll(1, -1) + 1.2 * target * (0.8 + 0.4 * grain) + 0.02 * grain
    wanted = (metric,) if metric else ("psnr", "speckle_contrast")
    scores = score(capture, target, metrics=wanted)
    scores |= {f"stored {key}": value for key, value in score(capture, target, metrics=wanted, stored=True).items()}
    own = {key: value for key, value in scores.items() if key.removeprefix("stored ").startswith(f"{wanted[0]}_")}
    kept = own if metric else {key: value for key, value in scores.items() if key not in own}
    if not metric:  # black in one colour, nearly so in another
        factors = match(capture, target * torch.tensor([1.0, 0.01, 0.0]).view(3, 1, 1))[1].tolist()
        kept |= {f"scale_{channel} of a target in red": factor for channel, factor in enumerate(factors)}
        for kind in ("", "stored "):  # together: a turn of nearly zero has no size of its own, and moves by rounding
            kept[f"{kind}refine"] = [kept.pop(f"{kind}refine_{part}") for part in ("dx_px", "dy_px", "theta_deg")]
    return {name: torch.tensor(value, dtype=torch.float64) for name, value in kept.items()}


def _control() -> dict[str, Tensor]:
    """The changes of a target and of a phase, and the scores of a model that takes gamma for light."""
    target, again = _smooth(3, (96, 128), 0.0, 1.0), _smooth(3, (96, 128), 0.01, 1.0)
    changed = {change: changed_target(target, change, 3, "golden") for change in (control.HALF, control.PATCH)}
    answers = {change: (other, other.square()) for change, other in changed.items()}
    scores = control.control(target, again, target.square(), answers)
    moved = {control.PHASE: moved_phase(_smooth(3, (96, 128), -9.0, 9.0), 3, "golden")}
    return changed | moved | {name: torch.tensor(value, dtype=torch.float64) for name, value in scores.items()}


def _alignment() -> dict[str, Tensor]:
    """A photograph through a mirror, a quarter turn and some perspective, with speckle."""
    draw = np.random.default_rng(5)
    target = photographed.photograph("coffee", (200, 250))
    homography, size = photographed.pose(draw, (200, 250), scale=1.3, turns=1, mirrored=True)
    alignment = align(photographed.captured(target, homography, size, draw), target)
    corners = torch.tensor(alignment.warp.corners())
    return {"corners": corners, "correlation": torch.tensor(alignment.correlation)}


# Retrieval with all terms of Eq. 22 but the critic's, through a network that shows what it is given. What the critic
# says is a number of its own: an eighth of its slope through normalised layers is rounding.
_RETRIEVAL = {"network": {"name": "identity"}, "training": small.ROUNDS, "start": {"iterations": 5, "offset": "none"}}
_RETRIEVAL["retrieval"] = {"iterations": 3, "step": 0.05, "adversarial": 0}


@contextmanager
def _short() -> Iterator[None]:
    """No hologram that a method asks another one for has converged."""
    with (
        patch.object(through, "Wirtinger", partial(Wirtinger, iterations=5)),
        patch.object(twin, "OPEN_LOOP", small.SHORT_OPEN_LOOP),
    ):
        yield


@_short()
def _method(name: str) -> dict[str, Tensor]:
    """Phases of a method, or their pictures; where it is trained, also what it learned and predicts."""
    method = small.quick(name, **SETTINGS.get(name, {}))
    judged = partial(_picture, PICTURES[name]) if name in PICTURES else _of_phase
    if name == "hil":
        spec = small.small_spec(48, 40, 3)
        identity = _trained(plugins.build("methods", name, _RETRIEVAL), small.small_spec(192, 176), judged)
        return _trained(method, spec, judged) | {
            **{f"retrieval {key}": identity[key] for key in ("cos", "sin")},
            "verdict": method.approximator(spec).verdict(small.pictures(spec)),
        }
    if name == "wirtinger_veil":
        with patch.object(small.BentDisplay, "capture", _hazy):  # where there is no veil, any reach is as good
            return _trained(method, small.small_spec(48, 40, 3), judged)
    if getattr(method, "trains", False):
        found = _trained(method, small.small_spec(48, 40, 3), judged)
        return {key: found[key] for key in found if name not in WITHOUT_WEIGHTS or not key.startswith("learned")}
    display, target = ToyDisplay(aberration=0.3, unmodulated=0.1, noise=0.02), picture()
    if name == "through":
        display = replace(display, spec=small.modelled())
        (target,) = small.pictures(display.spec)
        with patch.object(
            through, "Wirtinger", partial(Wirtinger, iterations=5)
        ):  # 200 in the place of its second start
            return judged(method.solve(target[None], display.handle(method, target)), display.spec)
    phase = method.solve(target[None], display.handle(method, target))
    found = judged(phase, display.spec)
    if getattr(method, "planes", False):
        stack = torch.stack([picture(), picture(1)])
        phase = method.solve_planes(stack, (0.0, 1e-4), display.handle(method, target))
        found |= {f"planes: {key}": value for key, value in judged(phase, display.spec).items()}
    return found


def _hazy(display: small.BentDisplay, phase: Tensor, capture: Any = small.BentDisplay.capture) -> Capture:
    """A photograph with a fifth of its light in a veil."""
    photograph = capture(display, phase)
    return replace(photograph, frame=veiled(photograph.frame, 0.2, 0.25))


def _trained(method: Any, spec: DisplaySpec, judged: Callable[[Tensor, DisplaySpec], Any]) -> dict[str, Tensor]:
    learned = small.through_a_file(dict(method.prepare(small.training_bench(spec, small.Memory(), images=2))))
    found = {name: value.float() for name, value in _leaves("learned", learned)}
    (target,) = small.pictures(spec, first=20)
    handle = small.solving_bench(method, target, spec, learned)
    phase = method.solve(target[None], handle)
    predicted = {"prediction": method.predict(phase, handle)} if hasattr(method, "predict") else {}
    return {**found, **judged(phase, spec), **predicted}


def _leaves(path: str, value: Any) -> Iterator[tuple[str, Tensor]]:
    """The tensors and numbers of what was learned, those of one network as one."""
    if isinstance(value, Mapping) and value and all(isinstance(part, Tensor) for part in value.values()):
        yield path, torch.cat([_real(part).flatten().float() for part in value.values()])
    elif isinstance(value, Mapping):
        for key, part in value.items():
            yield from _leaves(f"{path} {key}", part)
    elif isinstance(value, Tensor | int | float):
        yield path, torch.as_tensor(value)


def _real(values: Tensor) -> Tensor:
    return torch.view_as_real(values) if values.is_complex() else values


def _of_phase(phase: Tensor, spec: DisplaySpec) -> dict[str, Tensor]:
    return {"cos": phase.cos(), "sin": phase.sin()}


def _picture(pixels: int, phase: Tensor, spec: DisplaySpec) -> dict[str, Tensor]:
    light = torch.stack([spec.region.crop(ideal_light(each, spec)) for each in phase])
    return {"picture": functional.avg_pool2d(light, pixels)}


def _smooth(channels: int, shape: tuple[int, int], low: float, high: float) -> Tensor:
    """A smooth random map ``(channels, *shape)`` between two values."""
    draw = torch.rand(1, channels, 9, 9, generator=seeds.generator("golden", channels, *shape))
    return low + (high - low) * functional.interpolate(draw, shape, mode="bilinear", align_corners=True)[0]


@contextmanager
def _one_thread() -> Iterator[None]:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


@contextmanager
def _no_weights() -> Iterator[None]:
    """Torch's hub cache empty: the numbers must not depend on which published weights lie there."""
    with tempfile.TemporaryDirectory() as empty, patch.dict(os.environ, TORCH_HOME=empty):
        yield


def main() -> int:
    """Bring the file up to date; 1 where numbers changed under a version that is still the same."""
    known, written, refused = cases(), recorded(), []
    shipped = {f"method {name}" for name in plugins.names("methods")}
    kept = {name: entry for name, entry in written.items() if name in known or name in shipped}
    for name, case in known.items():
        numbers = case.numbers()
        if name not in kept or kept[name]["version"] != case.version:
            kept[name] = {"version": case.version, "numbers": numbers}
            print(f"written: {name}")
        elif problem := complaint(name, case, numbers, kept[name]):
            refused.append(problem)
    lines = json.dumps(dict(sorted(kept.items())), indent=1)
    FILE.write_text(lines + "\n", encoding="utf-8")
    print("\n".join(refused) or f"{FILE.name} is up to date", file=sys.stderr if refused else sys.stdout)
    return bool(refused)


if __name__ == "__main__":
    sys.exit(main())
