"""Draws what every stage of the simulated bench alone does to a picture, by the bench itself.

The display is ``ideal`` on a small panel, and one hologram, solved for it, is shown in every picture. Then one stage
takes values of a shipped profile, or those of ``SHOWN`` where shipped values are too small to be seen or switched off.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import torch
from matplotlib.axes import Axes
from torch import Tensor

from holobench_eval.datasets.photographs import Photographs
from holobench_eval.display import Profile, load_profile
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.stages import Panel
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics import match, score
from holobench_eval.optics import srgb_encode
from holobench_eval.report.charts.look import new_figure, style
from holobench_eval.study.opening import open_bench

PANEL, TARGET, STEPS = (192, 192), "astronaut", 100
LARGEST_CHANGE = 0.3  # of linear light, at the ends of the colour scale


@dataclass(frozen=True)
class Shown:
    """How a stage is shown.

    values: of the stage; of: the profile whose values they stand beside (empty: the stage's defaults); base: changes
    of ``ideal`` under both pictures; at: "image" (the noise-free image plane), "frame" (the picture as the sensor reads
    it out) or "rectified" (a capture in the frame of the target); gain: phase gain of the frame; words: of the values,
    for the caption.
    """

    words: str
    values: Mapping[str, Any] = field(default_factory=dict)
    of: str = ""
    base: Mapping[str, Any] = field(default_factory=dict)
    at: str = "image"
    gain: float = 1.0


shipped = cache(load_profile)
FINE = {"sampling": 3}
SHOWN: dict[str, Shown] = {
    "panel": Shown("4 bits in the place of 8", {"bits": 4}, "ideal"),
    "lens": Shown("`move: [0.03, 0.03, 0]`, the camera stays at its place", {"move": (0.03, 0.03, 0.0)}),
    "lut": Shown("the values of `leto-aged`", of="leto-aged"),
    "crosstalk": Shown("the width of `leto-aged`, 0.45 px", of="leto-aged", base=FINE),
    "aperture": Shown("the values of `leto-2020`", of="leto-2020", base=FINE),
    "flicker": Shown("a frame whose phase gain is 5 % too high", gain=1.05),
    "spectrum": Shown(
        "light-emitting diodes of 30 nm, behind the blaze and the iris of `leto-2020`",
        {"width": (3e-8, 3e-8, 3e-8), "lines": 9},
        base={"panel": shipped("leto-2020").panel},
    ),
    "illumination": Shown("the values of `leto-2020`", of="leto-2020"),
    "coherent_noise": Shown(
        "the panel's dirt of `leto-2020`, without the dust plane", {"plane_specks": 0}, "leto-2020"
    ),
    "propagation": Shown("the values of `leto-aged`", of="leto-aged"),
    "eye": Shown("`focus: [0.03, 0, 0]`, an astigmatic eye", {"focus": (0.03, 0.0, 0.0)}),
    "zero_order": Shown("the values of `leto-aged`, on axis", of="leto-aged"),
    "dust_plane": Shown("the 12 specks of `leto-2020` on their plane, a clean panel"),
    "stray_light": Shown("the values of `leto-2020`", of="leto-2020"),
    "relay": Shown(
        "turned by 3 degrees, with `perspective: [0.05, -0.03]`; the frame as read out, and after registration",
        {"rotation": 3.0, "shift": (0.016, -0.012), "perspective": (0.05, -0.03), "distortion": 0.01},
        at="frame",
    ),
    "sensor": Shown(
        "the camera of `leto-2020` at a hundredth of its light", {"headroom": 800.0}, "leto-2020", at="rectified"
    ),
    "drift": Shown(
        "365 days at the rates of `leto-2020`, on a panel as dirty as that profile's",
        {"days": 365.0},
        "leto-2020",
        base={"coherent_noise": replace(shipped("leto-2020").coherent_noise, plane_specks=0)},
    ),
}


def with_stage(name: str) -> tuple[Profile, Profile]:
    """The profile without a stage, as ``SHOWN`` has it, and with the stage."""
    shown = SHOWN[name]
    without = replace(shipped("ideal"), **dict(shown.base))
    if name == "dust_plane":  # its parameters are those of the coherent noise
        dirt = shipped("leto-2020").coherent_noise
        return without, replace(without, coherent_noise=replace(dirt, specks=0, scratches=0, roughness=0.0))
    stage = getattr(shipped(shown.of) if shown.of else without, name)
    return without, replace(without, **{name: replace(stage, **dict(shown.values))})


@dataclass(frozen=True)
class Seen:
    """A picture and its score. light: ``(C, h, w)``, matched to the target or, for a frame, to its own peak."""

    light: Tensor
    psnr: float | None


@cache
def hologram(panel: Panel) -> tuple[Tensor, Tensor]:
    """The target ``(C, h, w)`` in linear light and a phase ``(C, H, W)`` [rad] for the nominal optics of a panel."""
    bench = open_bench(replace(shipped("ideal"), panel=panel), PANEL)
    target = Photographs(names=(TARGET,)).load(TARGET, bench.spec.region.shape)
    method = Wirtinger(iterations=STEPS)
    return target, method.solve(target[None], bench.for_method(method, "", target, TARGET, 0))[0]


_without: dict[str, Seen] = {}


@torch.no_grad()
def seen(profile: Profile, phase: Tensor, target: Tensor, shown: Shown) -> Seen:
    """What a display makes of a phase."""
    if shown.at == "rectified":
        capture = open_bench(profile, PANEL).photograph(phase, target, TARGET, 0)
        return _matched(capture.image, target)
    bench = SimulatedBench(profile.scaled(PANEL))
    if shown.at == "frame":
        light = bench.photograph(phase, (100.0,) * 3, torch.Generator().manual_seed(0)).linear()
        return Seen((light / light.quantile(0.995)).clamp(0, 1), None)
    step = bench.image_samples
    colours = [bench.integrated(phase[channel], channel, shown.gain)[::step, ::step] for channel in range(3)]
    return _matched(bench.spec.region.crop(torch.stack(colours)), target)


def _matched(light: Tensor, target: Tensor) -> Seen:
    psnr = score(light, target, metrics=("psnr",), refine=False, blur=())["psnr_linear"]
    return Seen(match(light, target)[0], psnr)


def draw(name: str, path: Path) -> None:
    """Draw a stage: the picture without and with it, their scores, and what has changed."""
    without, profile = with_stage(name)
    shown = SHOWN[name]
    target, phase = hologram(without.panel)
    key = f"{shown.base} {shown.at}"  # most stages have one picture without them
    if key not in _without:
        _without[key] = seen(without, phase, target, replace(shown, gain=1.0))
    before, after = _without[key], seen(profile, phase, target, shown)
    with style():
        figure = new_figure(1100, 365)
        axes = [figure.add_axes((left, 0.02, 0.3, 0.88)) for left in (0.0, 0.305, 0.61)]  # a layout engine is slow
        _picture(axes[0], before.light, "without" + _decibels(before))
        _picture(axes[1], after.light, "with" + _decibels(after))
        if shown.at == "frame":
            last = open_bench(profile, PANEL).photograph(phase, target, TARGET, 0)
            registered = _matched(last.image, target)
            _picture(axes[2], registered.light, f"registered{_decibels(registered)}")
        else:
            _change(axes[2], after.light - before.light)
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, metadata={"Software": None})  # equal pictures have equal bytes


def _decibels(picture: Seen) -> str:
    return "" if picture.psnr is None else f", {picture.psnr:.1f} dB"


def _picture(axes: Axes, light: Tensor, title: str) -> None:
    axes.imshow(srgb_encode(light.clamp(0, 1)).permute(1, 2, 0).float().numpy(), interpolation="nearest")
    axes.set_title(title)
    axes.set_axis_off()


def _change(axes: Axes, change: Tensor) -> None:
    limits = {"vmin": -LARGEST_CHANGE, "vmax": LARGEST_CHANGE}
    drawn = axes.imshow(change.mean(0).numpy(), cmap="RdBu_r", interpolation="nearest", **limits)
    axes.set_title("change of the light")
    axes.set_axis_off()
    beside = axes.figure.add_axes((0.925, 0.06, 0.012, 0.8))
    axes.figure.colorbar(drawn, cax=beside, label="linear light")
