"""What a bench must pass before any study: a linear camera, and the phase convention that the methods have.

What a photograph can and cannot tell. A reversed sign sends the picture to the other side of the panel, so that the
camera sees it blurred over twice the distance: a hologram that starts with random phase is then unreadable, while one
with a smooth phase may still show a ghost of itself, and so the letter is shown with random phase. A wrong level of the
full turn sends light into other orders and dims the picture. A mirrored panel and a mirrored camera, by contrast,
look alike in every photograph, since light travels the same way in a mirror; the registration absorbs both, and the
check only reports what it saw. A constant ``origin`` changes nothing but the interference with unmodulated light.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from torch import Tensor

from ..imaging.convention import FEWEST, MOST, Convention
from ..imaging.warp import Array, Frame
from .dark import Dark
from .exposure import Averaged
from .photograph import MOST_SATURATED
from .test_pattern import PatternFit, find_pattern

# photograph of a phase `(C, H, W)` [rad] under a convention: light `(C, Hs, Ws)`
Show = Callable[[Tensor, Convention], Tensor]

EXPOSURES = tuple(8 ** (step / 4 - 1) for step in range(5))  # an eighth to one
STRAIGHTEST, FURTHEST_OFFSET = 0.999, 0.02
BRIGHTEST = 0.02  # of the samples are followed
READABLE = 0.6  # correlation with the letter: about 0.9 on a good bench, 0.3 to 0.7 on the wrong side of the panel
CLEARLY = 1.5  # times the light in the letter's strokes
FULL_TURNS = (0.7, 0.8, 0.9, 1.0, 1.12, 1.25, 1.4)  # of two_pi_level
DIM, DIMMER = 0.75, 0.95  # of the light at the best level: refused, remarked on


@dataclass(frozen=True)
class Check:
    """Whether a bench may be measured on, and why, in one line."""

    passed: bool
    line: str


def linearity(take: Callable[[float], Averaged], seconds: float, dark: Dark) -> Check:
    """Five exposures of a steady picture over a factor of eight: is light times time what the camera counts?

    take: photographs for so many seconds; seconds: the longest exposure, which saturates nothing. The same bright
    samples are followed through all exposures, chosen in a frame of their own, so that their noise chooses nothing.
    """
    chosen = take(seconds)
    bright = chosen.counts >= np.quantile(chosen.counts, 1 - BRIGHTEST)
    bright &= ~chosen.saturated
    taken = [take(share * seconds) for share in EXPOSURES]
    lost = max(float(each.saturated.mean()) for each in taken)
    if lost > MOST_SATURATED or not bright.any():
        return Check(False, f"linearity: {lost:.2%} of the samples are saturated; shorten capture.exposure")
    times = np.array([each.seconds for each in taken])
    if times[-1] < 4 * times[0]:
        given = f"{times[0]:.2g} to {times[-1]:.2g} s"
        return Check(False, f"linearity: the camera gave exposures of {given} only; it needs a factor of eight to tell")
    light = np.array([float(np.mean(dark.off(each.counts, each.seconds)[bright])) for each in taken])
    straight, offset = _affine(times, light)
    figures = f"r^2 {straight:.5f}, offset {offset:+.1%} of the longest exposure"
    if straight > STRAIGHTEST and abs(offset) <= FURTHEST_OFFSET:
        return Check(True, f"linearity: {figures}")
    return Check(
        False,
        f"linearity: {figures} (wanted: r^2 > {STRAIGHTEST}, at most {FURTHEST_OFFSET:.0%}); "
        "is there gamma, automatic gain or an unsteady laser?",
    )


def _affine(times: Array, light: Array) -> tuple[float, float]:
    """r^2 of a straight line, and its value at no exposure relative to that at the longest."""
    slope, start = np.polyfit(times, light, 1)
    spread = float(np.sum((light - light.mean()) ** 2))
    if spread == 0 or slope <= 0:
        return 0.0, 1.0
    rest = float(np.sum((light - start - slope * times) ** 2))
    return 1 - rest / spread, float(start / (start + slope * times[-1]))


def phase_sign(show: Show, phase: Tensor, convention: Convention) -> Check:
    """Does the letter of a hologram ``phase`` ``(C, H, W)`` appear, and with the sign as it is set?

    phase: for `test_pattern.draw_pattern` over the scored region, nominal optics, random starting phase.
    """
    reversed_ = replace(convention, sign=-convention.sign)
    pictures = [_frames(show(phase, each)) for each in (convention, reversed_)]
    as_set, other = ([find_pattern(frame) for frame in picture] for picture in pictures)
    here, there = _worst(as_set), _worst(other)
    figures = f"(correlation {here:.2f}; with the sign reversed {there:.2f})"
    if here >= READABLE and _brighter(as_set, pictures[0], pictures[1]):
        return Check(True, f"phase convention: {_orientation(as_set, convention)} {figures}")
    if there >= READABLE and _brighter(other, pictures[1], pictures[0]):
        return Check(
            False,
            f"phase convention: out of focus as with the sign reversed; set phase.sign: {reversed_.sign} {figures}",
        )
    return Check(
        False,
        f"phase convention: no letter F with either sign {figures}; look at the camera's focus, panel.distance, "
        f"panel.pitch, phase.two_pi_level{', phase.correction' if convention.correction else ''} and the iris",
    )


def full_turn(show: Show, phase: Tensor, convention: Convention) -> Check:
    """Is ``two_pi_level`` the level at which the letter of `phase_sign` gets most light?

    Each level is shown with two constant phases half a turn apart, whose mean has no interference with unmodulated
    light. Every colour has a best level of its own. A panel with a crooked look-up table has its best level elsewhere,
    so that a small difference is reported and not refused.
    """
    fits: list[PatternFit] = []
    levels, light = [], []
    for ratio in (1.0, *(each for each in FULL_TURNS if each != 1)):
        tried = np.clip(np.atleast_1d(convention.two_pi_level) * ratio, FEWEST, MOST).tolist()
        turn = replace(convention, two_pi_level=tuple(tried) if len(tried) > 1 else tried[0])
        picture = (show(phase, turn) + show(phase + math.pi, turn)) / 2
        fits = fits or [find_pattern(frame) for frame in _frames(picture)]
        levels.append(np.resize(tried, len(fits)))
        light.append(_light(fits, _frames(picture)))
    strengths = np.array(light) / np.maximum(np.max(light, axis=0), 1e-12)
    peaks = [_peak(*each) for each in zip(np.array(levels).T, strengths.T, strict=True)]
    share = float(np.mean([strength / peak for strength, (_, peak) in zip(strengths[0], peaks, strict=True)]))
    line = f"phase.two_pi_level: {_text(convention.two_pi_level, 'g')} gives {min(share, 1):.0%} of the light"
    if share >= DIMMER:
        return Check(True, f"{line} of the best level")
    best = _text([level for level, _ in peaks], ".0f")
    return Check(share >= DIM, f"{line} of {best}; {'set it to that' if share < DIM else 'consider that'}")


def _text(levels: float | Sequence[float], form: str) -> str:
    """A level, or a list of the colours' levels where they differ."""
    texts = [format(level, form) for level in np.atleast_1d(levels)]
    return texts[0] if len(set(texts)) == 1 else f"[{', '.join(texts)}]"


def _peak(levels: Array, strengths: Array) -> tuple[float, float]:
    """The level of most light and that light, by a parabola through the three points around the highest."""
    order = np.argsort(levels)
    x, y = levels[order], strengths[order]
    top = int(np.argmax(y))
    if not 0 < top < len(x) - 1:
        return float(x[top]), float(y[top])
    near = slice(top - 1, top + 2)
    a, b, c = np.polyfit(x[near] - x[top], y[near], 2)
    if a >= 0:
        return float(x[top]), float(y[top])
    return float(x[top] - b / (2 * a)), float(c - b * b / (4 * a))


def _orientation(fits: Sequence[PatternFit], convention: Convention) -> str:
    first = fits[0]
    if any((fit.mirrored, fit.quarter) != (first.mirrored, first.quarter) for fit in fits):
        return "the channels are turned or mirrored differently, though sharp"
    turned = f"turned by {90 * first.quarter} degrees anticlockwise" if first.quarter else ""
    if not first.mirrored:
        return turned or "upright"
    # an upside-down mirror image is one turned by half a turn
    axis, key, present = (
        ("upside down", "flip_vertical", convention.flip_vertical)
        if first.quarter == 2
        else ("left-right", "flip_horizontal", convention.flip_horizontal)
    )
    and_turned = f" and {turned}" if first.quarter in (1, 3) else ""
    return (
        f"mirrored {axis}{and_turned}, by the relay or by the panel, which no photograph tells apart (if by the panel, "
        f"set phase.{key}: {str(not present).lower()}); registration takes care of both"
    )


def _brighter(fits: Sequence[PatternFit], picture: Sequence[Frame], other: Sequence[Frame]) -> bool:
    """Is the letter clearly brighter in its picture than, at the same place, in the other?"""
    pairs = zip(_light(fits, picture), _light(fits, other), strict=True)
    return all(light > CLEARLY * max(ghost, 0) for light, ghost in pairs)


def _light(fits: Sequence[PatternFit], picture: Sequence[Frame]) -> list[float]:
    return [fit.light(frame) for fit, frame in zip(fits, picture, strict=True)]


def _worst(fits: Sequence[PatternFit]) -> float:
    return min(fit.correlation for fit in fits)


def _frames(light: Tensor) -> list[Frame]:
    return list(light.detach().cpu().float().numpy())
