"""Phases that no display can show, which are refused, and phases that are odd, of which a sentence is said."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import Parameter
from torch.nn.functional import avg_pool2d

from ..core.errors import CellError
from ..optics.phase import FARTHEST, are_levels, farthest
from .api import DisplaySpec
from .nominal import ideal_light, nominal_levels

# Correlations of an image with its target. On photographs, phases of the methods here have 0.97 and more; those that
# were found with captures and make up for faults of a display have 0.82 and more, and 0.49 on leto-aged. No other pose,
# sign or unit comes within 0.15 of these. Amplitudes in the place of phases have at most 0.37.
RIGHT, BETTER, UNLIKE = 0.85, 0.1, 0.4
GRAIN = 4  # pixels a side over which speckle is averaged
FAINT = 0.03  # of the mean amplitude; of a target with less contrast, right phases too may come below UNLIKE
JUMP = 10 * math.tau  # rad between neighbours, which radians, wrapped or smooth, have no need of
EDGE = 0.02  # of a span, by which the values of a phase in another unit may miss its ends
FACTOR = "multiplied by"
CLOSER = 0.7  # of the lack of correlation, to which a right factor brings a phase that makes its target without it
TIE = 0.01  # by which a factor has to fit better than a unit, which it nearly is where the values fill the unit's span

UNITS = {  # what values in a span may be, and what makes radians of them
    (0.0, 1.0): ("turns or amplitudes", math.tau),
    (-0.5, 0.5): ("turns", math.tau),
    (0.0, 2.0): ("half turns", math.pi),
    (-1.0, 1.0): ("half turns", math.pi),
    (0.0, 256.0): ("levels of 8 bits", math.tau / 256),
    (0.0, 360.0): ("degrees", math.tau / 360),
    (-180.0, 180.0): ("degrees", math.tau / 360),
    (-3600.0, 3600.0): ("degrees", math.tau / 360),  # of a phase that is not wrapped
}
MIRRORED = {"": (), "mirrored left to right": (-1,), "mirrored top to bottom": (-2,), "turned by 180 degrees": (-2, -1)}


def single(output: Tensor, channels: int) -> Tensor | None:
    """The hologram of one image that ``solve`` gave, ``(1, C, H, W)`` to ``(C, H, W)``, or of several frames
    ``(1, F, C, H, W)`` to ``(F, C, H, W)``; None for another shape."""
    if output.ndim == 5 and output.shape[1] == 1:
        output = output[:, 0]
    fits = output.ndim in (4, 5) and len(output) == 1 and output.shape[-3] == channels
    return output[0] if fits else None


def check_phase(phase: Tensor, spec: DisplaySpec, label: str) -> None:
    """Refuse a phase ``(C, H, W)`` or frames ``(F, C, H, W)`` [rad] that the display cannot show. label: name of the
    method in the error message.

    CellError for another shape or type, a subclass of ``Tensor`` among them, and as by ``check_radians``.
    """
    who = f"{label}: " if label else ""
    if not is_plain(phase):
        raise CellError(f"{who}phase is {type_name(phase)}, the display shows a plain torch.Tensor")
    if phase.ndim not in (3, 4) or tuple(phase.shape[-2:]) != spec.shape:
        raise CellError(f"{who}phase is {tuple(phase.shape)}, the display shows (C, {spec.shape[0]}, {spec.shape[1]})")
    if phase.ndim == 4 and not 1 <= len(phase) <= spec.frames:
        raise CellError(f"{who}phase has {len(phase)} frames, the display shows {spec.frames} at most in an exposure")
    check_radians(phase, who)


def check_radians(phase: Tensor, who: str) -> None:
    """Refuse values that are no phase [rad] of any display. who: what stands before "phase" in the error message.

    CellError for another type, and for values that are not finite, too large or levels.
    """
    if phase.is_complex() or not phase.is_floating_point():
        raise CellError(f"{who}phase is {phase.dtype}, the display shows real numbers in radians")
    if bad := int((~torch.isfinite(phase.float())).sum()):  # in the precision that the display computes in
        raise CellError(f"{who}phase holds {bad} values that are NaN or infinite; the display refuses it")
    if (largest := farthest(phase)) > FARTHEST:
        raise CellError(
            f"{who}phase reaches {largest:.4g} rad, where float32 has lost the turn; expected it modulo 2 pi"
        )
    if are_levels(phase):
        raise CellError(f"{who}phase has whole numbers up to {phase.max():g}: levels; expected radians, modulo 2 pi")


def phase_doubt(phase: Tensor, target: Tensor, spec: DisplaySpec) -> str:
    """What is odd about a phase, told from the nominal model, on which no fault of a display hides it.

    A mirrored phase makes the mirrored image, so that poses cost nothing: a phase that makes its target takes one
    propagation a colour, any other up to eight.

    Parameters
    ----------
    phase
        ``(C, H, W)`` or ``(F, C, H, W)`` [rad] that the display can show, see ``check_phase``.
    target
        ``(C, h, w)`` linear light in [0, 1].
    spec
        The display's nominal optics.

    Returns
    -------
    str
        What to say of the phase, such as "fits its target better with the opposite sign ..."; empty where nothing is
        odd, and for a phase or a target without structure, which a target has where its contrast is above its speckle.
    """
    phase, target = phase.detach().cpu().float(), target.detach().cpu().float()
    low, high = (float(value) for value in phase.aminmax())
    as_given = _fits(phase, target, spec)
    own = as_given.get("", 1.0)
    if low == high or not as_given:
        return ""
    if own >= RIGHT:  # a table of levels may fill no turn, and any other scale may then do a little more
        return "" if spec.levels else _turn_doubt(phase, target, spec, own)
    fits = [(fit, pose) for pose, fit in as_given.items()]
    for how, values in {"with the opposite sign": -phase, "with red and blue exchanged": phase.flip(-3)}.items():
        fits += _fits_of(how, values, target, spec)
    for how, scale in _scales(phase).items():
        # An amplitude, or the magnitude of a phase, is somewhat like its target in any unit; the right unit is more.
        fits += [each for each in _fits_of(how, scale * phase, target, spec) if each[0] >= RIGHT]
    best, how = max(fits, key=lambda each: each[0] - TIE * each[1].startswith(FACTOR))
    if best >= own + BETTER and best >= UNLIKE:
        return _better(how, best, own)
    correlation = f"correlation {own:.2f} with its target on the nominal model, where holograms have about 0.9"
    if _is_amplitude(phase, target, spec):
        return f"grows with the amplitude of the light that makes its target, and is not its phase ({correlation})"
    if own < UNLIKE or unit_doubt(phase):
        like = "nothing like" if own < UNLIKE else "little of"
        return f"makes {like} its target (values from {low:.2f} to {high:.2f}; {correlation})"
    return ""


def _scales(phase: Tensor) -> dict[str, float | Tensor]:
    """What makes radians of values in so wide a range: of those in another unit, and as by ``_turns``."""
    low, high = (float(value) for value in phase.aminmax())
    within = [UNITS[first, last] for first, last in UNITS if first <= low and high <= last]
    return {f"read as {unit.partition(' or ')[0]}": scale for unit, scale in within} | _turns(phase)


def _turns(phase: Tensor) -> dict[str, float | Tensor]:
    """What makes the values fill a turn, in all colours together or in each ``(C, 1, 1)`` that has any structure."""
    colours = phase.movedim(-3, 0).flatten(1)
    spans, span = colours.amax(1) - colours.amin(1), float(phase.max() - phase.min())
    scales = dict[str, float | Tensor]()
    if abs(math.tau / span - 1) >= EDGE:
        scales[f"{FACTOR} {math.tau / span:.3g}"] = math.tau / span
    wide = spans >= EDGE * span
    factors = torch.where(wide, math.tau / spans, 1.0)
    if wide.any() and float(factors[wide].max() / factors[wide].min() - 1) >= EDGE:
        each = ", ".join(f"{value:.3g}" for value in factors.tolist())
        scales[f"{FACTOR} {each}, colour by colour, as by another two_pi_level"] = factors[:, None, None]
    return scales


def _turn_doubt(phase: Tensor, target: Tensor, spec: DisplaySpec, own: float) -> str:
    """Of a phase that makes its target, whether one that fills a turn makes it much better; empty where none does."""
    fits = {how: _fits(scale * phase, target, spec)[""] for how, scale in _turns(phase).items()}
    best = max(fits, key=fits.__getitem__, default="")
    return _better(best, fits[best], own) if best and 1 - fits[best] <= CLOSER * (1 - own) else ""


def _better(how: str, fit: float, own: float) -> str:
    return f"fits its target better {how} (correlation {fit:.3f} on the nominal model; as it is, {own:.3f})"


def _fits_of(how: str, phase: Tensor, target: Tensor, spec: DisplaySpec) -> list[tuple[float, str]]:
    """The fits of values that were read otherwise, each with how, and with the pose."""
    return [(fit, f"{how}, {pose}".removesuffix(", ")) for pose, fit in _fits(phase, target, spec).items()]


def _is_amplitude(values: Tensor, target: Tensor, spec: DisplaySpec) -> bool:
    """Whether values ``(C, H, W)`` are, in any unit, the amplitude of the target's light at the panel."""
    pairs = []
    for channel, plane in enumerate(target if values.ndim == 3 else ()):
        field = spec.region.embed(plane.sqrt(), spec.shape).to(torch.complex64)
        back = spec.propagator(channel).adjoint(field).abs()
        pairs.append(torch.stack([values[channel].flatten(), back.flatten()]).corrcoef()[0, 1])
    return bool(pairs) and float(torch.stack(pairs).nanmean()) >= RIGHT  # a colour without light has none


def unit_doubt(phase: Tensor) -> str:
    """Which other unit the values of a phase ``(..., H, W)`` seem to have; empty where there is none.

    They fill its span from end to end; or lie in that of turns, or in another one and jump by more than radians would.
    """
    low, high = (float(value) for value in phase.aminmax())
    within = {span: unit for span, (unit, _) in UNITS.items() if span[0] <= low < high <= span[1]}
    gaps = {span: EDGE * (span[1] - span[0]) for span in within}
    jumps = any((phase.diff(dim=axis).abs() > JUMP).any() for axis in (-2, -1))
    units = [within[span] for span, gap in gaps.items() if low <= span[0] + gap and span[1] - gap <= high]
    units += [within[first, last] for first, last in within if last - first <= 1 or jumps]
    return f"has values from {low:.2f} to {high:.2f}, as {units[0]} have" if units else ""


def _fits(phase: Tensor, target: Tensor, spec: DisplaySpec) -> dict[str, float]:
    """The correlation of amplitudes of image and target, mean over colours, by the pose of the file; empty where the
    target is even, or nearly so, in all colours."""
    image = ideal_light(nominal_levels(phase, spec), spec)
    poses = {name: image.flip(axes) for name, axes in MIRRORED.items()}
    if spec.shape[0] == spec.shape[1]:
        poses |= {f"transposed, {name}".removesuffix(", "): pose.mT for name, pose in poses.items()}
    wanted = _structure(target, FAINT)
    lit = wanted.norm(dim=1) > 0
    if not lit.any():
        return {}
    shown = {name: _structure(spec.region.crop(pose)) for name, pose in poses.items()}
    return {name: float((made * wanted).sum(1)[lit].mean()) for name, made in shown.items()}


def _structure(image: Tensor, faint: float = 0.0) -> Tensor:
    """Amplitudes ``(C, n)`` of an image ``(C, h, w)`` behind its speckle, of mean zero and norm one; zero where their
    contrast is at most ``faint``."""
    coarse = avg_pool2d(image[None], GRAIN)[0].sqrt().flatten(1)
    mean = coarse.mean(1, keepdim=True)
    coarse = coarse - mean
    norm = coarse.norm(dim=1, keepdim=True)
    least = (faint * mean).clamp_min(1e-4) * math.sqrt(coarse.shape[1])
    return torch.where(norm > least, coarse / norm.clamp_min(1e-12), 0.0)


def is_plain(value: object) -> bool:
    """Whether a value is a tensor of torch's own: another class would run its own code inside the bench."""
    return type(value) in (Tensor, Parameter)


def from_numpy(value: Any) -> Any:
    """What a method returned: an array of float32 or float64 as the tensor that it stands for, all else as it is."""
    if type(value) is not np.ndarray or value.dtype.kind != "f" or value.dtype.itemsize not in (4, 8):
        return value
    return torch.from_numpy(np.array(value, dtype=value.dtype.newbyteorder("="), order="C"))


def type_name(value: object) -> str:
    """What a value is called in messages; an array with the type of its numbers."""
    return f"ndarray of {value.dtype}" if type(value) is np.ndarray else type(value).__name__
