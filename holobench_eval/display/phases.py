"""Phases that no display can show, which are refused, and phases that are odd, of which a sentence is said."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import permutations, product
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import Parameter
from torch.nn.functional import avg_pool2d, interpolate

from ..core.errors import CellError
from ..optics.angular_spectrum import angular_spectrum_phase
from ..optics.convolution import frequencies, iris
from ..optics.phase import FARTHEST, are_levels, farthest
from ..optics.phasor import phasor, squared_modulus
from .api import DisplaySpec, Region
from .nominal import ideal_light, nominal_levels, propagated

# Correlations of the amplitudes of an image and its target, by means over so many pixels a side: fine ones tell what
# fits better, coarse ones are free of speckle. Measured at 128 x 128 pixels on 5 photographs and 8 drawn pictures, the
# phases of methods without a camera have 0.95 and more (fine, photographs) and 0.91 of what can be had (all); those
# that were found with captures 0.7 and more (photographs). None of 661 right ones fitted better at another distance or
# with other lasers; of 12 wrong ones of a kind (distance by 15 %, pitch, order, pose, halves, place) each was named.
FINE, COARSE = 2, 4
GOOD = 0.97  # fine: a fit that leaves nothing to be asked
LEAST = {FINE: 0.9, COARSE: 0.95}  # of the fit that can be had
UNLIKE = 0.4  # coarse; amplitudes in the place of phases have at most 0.37
# The lack of correlation that another meaning leaves is at most so much of what there was: where it fits well, or not.
RIGHT, CLOSER, MUCH_CLOSER = 0.85, 0.5, 0.35
MOST = math.log(4.0)  # of the factors of the distance that are tried, and of those that are told apart from 1
NEAR = 0.03
SPREADS = (16, 64, 128, 256)  # pixels
ALL = "as if all lasers were of about"
FAINT = 0.03  # of the mean amplitude; of a target with less contrast, right phases too may come below UNLIKE
JUMP = 10 * math.tau  # rad between neighbours, which radians, wrapped or smooth, have no need of
EDGE = 0.02  # of a span, by which the values of a phase in another unit may miss its ends
CAUSES = (
    "other optics or turns, a correction map missing or left in, faults of a display that it makes up for, or a rough "
    "method"
)
FACTOR = "multiplied by"
TIE = 0.001  # by which a later meaning has to fit better, and a factor by ten times that: a unit is nearly one

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
COLOURS = ("red", "green", "blue")
ORDERS = {", ".join(COLOURS[c] for c in order): order for order in list(permutations(range(3)))[1:]}
HALVES = {"left and right halves": (-1,), "upper and lower halves": (-2,), "halves": (-2, -1)}
TURNED = "turned by 180 degrees"
MIRRORED = {"mirrored left to right": (-1,), "mirrored top to bottom": (-2,), TURNED: (-2, -1)}


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


def phase_doubt(phase: Tensor, target: Tensor, spec: DisplaySpec, seen: bool = False, computed: bool = False) -> str:
    """What is odd about a phase, told from the nominal model, on which no fault of a display hides it.

    A phase that makes its target takes one propagation a colour, any other some dozens: what it may have been meant for
    is tried in turn, see ``_meanings``. A mirrored phase makes the mirrored image, so that poses cost nothing.

    Parameters
    ----------
    phase
        ``(C, H, W)`` or ``(F, C, H, W)`` [rad] that the display can show, see ``check_phase``.
    target
        ``(C, h, w)`` linear light in [0, 1].
    spec
        The display's nominal optics.
    seen
        Whether captures of the display may have told how the phase makes up for faults of it.
    computed
        Whether a method has computed it for these optics, and not a file given it: that the method is rough is its own
        matter, and its scores show it.

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
    if low == high or own >= GOOD:
        return ""
    best, how = 0.0, ""
    for words, values, optics in _meanings(phase, target, spec):
        # An amplitude, or the magnitude of a phase, is somewhat like its target in any unit; the right unit is more.
        least = RIGHT if words.startswith(("read", FACTOR)) or optics is not spec else 0.0
        least = max(least, best + TIE * (10 if words.startswith(FACTOR) else 1))
        fit, pose = max((fit, pose) for pose, fit in _fits(values, target, optics).items())
        if fit >= least:
            best, how = fit, f"{words}, {pose}".strip(", ")
        if best >= GOOD and 1 - best <= MUCH_CLOSER * (1 - own):
            break
    if 1 - best <= (CLOSER if best >= RIGHT else MUCH_CLOSER) * (1 - own):
        return f"fits its target better {how} (correlation {best:.3f} on the nominal model; as it is, {own:.3f})"
    back = propagated(spec.region.embed(target.sqrt(), spec.shape).to(torch.complex64), spec, back=True)
    image = squared_modulus(propagated(back, spec))  # of light whose amplitude is free, too
    most = {grain: float(_compared(image, target, spec, grain)[""].mean()) for grain in LEAST}
    has = {FINE: own, COARSE: _fits(phase, target, spec, COARSE).get("", 0.0)}  # a fine pattern is even
    numbers = f"{has[COARSE]:.2f} with its target on the nominal model, where {most[COARSE]:.2f} can be had"
    if any(has[grain] >= least * most[grain] for grain, least in LEAST.items()):
        return ""
    if _is_amplitude(phase, back):
        return (
            f"grows with the amplitude of the light that makes its target, and is not its phase (correlation {numbers})"
        )
    if unit_doubt(phase) or (has[COARSE] < UNLIKE and not seen):
        like = "nothing like" if has[COARSE] < UNLIKE else "little of"
        return f"makes {like} its target (values from {low:.2f} to {high:.2f}; correlation {numbers})"
    if not (seen or computed):
        return f"makes its target less well than phases for these optics can (correlation {numbers}): {CAUSES}"
    return ""


def _meanings(phase: Tensor, target: Tensor, spec: DisplaySpec) -> Iterator[tuple[str, Tensor, DisplaySpec]]:
    """What a phase may have been meant for, in words, and the phase and the optics that then make its target."""
    yield "", phase, spec
    yield "with the opposite sign", -phase, spec
    for name, order in ORDERS.items() if len(target) == len(COLOURS) else ():
        others = [colour for colour, c in zip(COLOURS, order, strict=True) if colour != COLOURS[c]]
        how = f"{' and '.join(others)} exchanged" if len(others) == 2 else f"its colours in the order {name}"
        yield f"with {how}", phase[..., order, :, :], spec
    rows, columns = (torch.arange(side) for side in spec.shape)
    checkers = math.pi * ((rows[:, None] + columns) % 2)
    for which, axes in HALVES.items():
        halves = phase.roll([spec.shape[axis] // 2 for axis in axes], axes)
        yield f"with its {which} exchanged (fftshift)", halves, spec
    for how, values in {"": phase, " and its halves exchanged": halves}.items():
        yield f"with half a turn added to every other pixel{how} (fftshift of the picture)", values + checkers, spec
    down, right = _aside(phase, target, spec)
    moved = phase.roll((-down, -right), (-2, -1))
    if spec.plane == "fourier":
        turns = math.tau * torch.tensor([spec.step(channel) for channel in range(len(target))])[:, None, None]
        moved = phase - turns * (down * rows[:, None] + right * columns)
    yield f"with its picture moved by {-down} rows and {-right} columns", moved, spec
    for how, scale in _scales(phase).items():
        yield how, scale * phase, spec
    yield from _geometries(phase, target, spec) if spec.plane == "fresnel" else ()


def _aside(phase: Tensor, target: Tensor, spec: DisplaySpec) -> tuple[int, int]:
    """How many rows and columns the image is away from where its amplitudes correlate best with those of its target."""
    amplitude, image, (height, width) = target.sqrt(), ideal_light(phase, spec), spec.shape
    ones = torch.ones_like(amplitude)
    windows = torch.stack([amplitude - amplitude.mean((-2, -1), keepdim=True), ones, ones])
    spectra = torch.fft.rfft2(spec.region.embed(windows, spec.shape)).conj()
    spectra = spectra * torch.fft.rfft2(torch.stack([image.sqrt(), image.sqrt(), image]))
    like, mean, power = torch.fft.irfft2(spectra, s=spec.shape)
    spread = (power - mean**2 / ones[0].numel()).clamp_min(1e-6 * float(power.max())).sqrt()
    down, right = divmod(int((like / spread).sum(0).argmax()), width)
    return (down + height // 2) % height - height // 2, (right + width // 2) % width - width // 2


def _geometries(phase: Tensor, target: Tensor, spec: DisplaySpec) -> Iterator[tuple[str, Tensor, DisplaySpec]]:
    """The three likeliest of other distances and lasers: peaks on a coarse grid, where they are wide, are followed to
    finer ones. A pitch is a distance, and so is a wavelength: each colour has a curve, which lasers shift."""
    waves = spec.wavelengths
    lasers = {"": waves}
    if len(waves) == len(COLOURS):
        lasers |= {
            f"as if the lasers were in the order {name}": tuple(waves[c] for c in order)
            for name, order in ORDERS.items()
        }
        lasers[ALL] = (waves[1],) * len(waves)
    steps, peaks = MOST * np.linspace(-1, 1, 25), []
    for sign in (1, -1):
        fits = _refocused(sign * phase, target, spec, SPREADS[0], steps)
        curves = {pose: np.array([fit[pose].numpy() for fit in fits]).T for pose in fits[0]}
        for (pose, colours), (name, others) in product(curves.items(), lasers.items()):
            shifts = np.log(np.divide(others, waves))
            curve = np.mean([np.interp(steps + d, steps, each) for d, each in zip(shifts, colours, strict=True)], 0)
            peaks.append((curve.max(), steps[curve.argmax()], name, pose, sign))
    for _, peak, name, pose, sign in sorted(each for each in peaks if each[0] >= UNLIKE)[-3:]:
        optics, width = replace(spec, wavelengths=lasers[name]), steps[1] - steps[0]
        for spread in SPREADS[1:]:
            near = peak + width * np.linspace(-1, 1, 7)
            fits = _refocused(sign * phase, target, optics, spread, near)
            peak, width = near[np.argmax([float(fit[pose].mean()) for fit in fits])], width / 3
        factor, how = math.exp(peak), ["with the opposite sign"] * (sign < 0) + [name] * bool(name)
        if name == ALL:
            how[-1] += f" {factor * waves[1] * 1e9:.0f} nm"
        elif abs(peak) > NEAR:
            how.append(
                f"at about {factor:.3g} times the distance, or for a pitch of {spec.pitch * 1e6 / factor**0.5:.3g} um"
            )
        else:
            factor = 1.0
        yield ", ".join(how), sign * phase, replace(optics, distance=factor * spec.distance)


def _refocused(
    phase: Tensor, target: Tensor, spec: DisplaySpec, spread: float, moves: Iterable[float]
) -> list[dict[str, Tensor]]:
    """The fits of the first frame, see ``_compared``, at exp(``moves``) times the distance, on a grid so coarse that
    light spreads by so many of its pixels."""
    finer = max(1.0, math.sqrt(max(spec.wavelengths) * spec.distance / (2 * spread)) / spec.pitch)
    shape, old = (round(spec.shape[0] / finer), round(spec.shape[1] / finer)), spec.region
    y, x = (few / many for few, many in zip(shape, spec.shape, strict=True))
    top, left = math.ceil(old.top * y), math.ceil(old.left * x)
    region = Region(top, left, int((old.top + old.height) * y) - top, int((old.left + old.width) * x) - left)
    small = replace(spec, shape=shape, region=region)
    wanted = region.crop(interpolate(old.embed(target, spec.shape)[None], shape, mode="area")[0])
    rows, columns = (torch.fft.fftfreq(2 * side, 0.5 / side).long() for side in shape)
    field = phasor(phase.new_ones(()), phase if phase.ndim == 3 else phase[0])
    spectrum = torch.fft.fft2(field, s=[2 * side for side in spec.shape])[:, rows[:, None], columns]
    fy, fx = frequencies((len(rows), len(columns)), spec.pitch / y)
    passed = iris(fy, fx, spec.pitch, spec.pupil).float()
    axial = torch.stack([angular_spectrum_phase(fy**2 + fx**2, wave, spec.distance) for wave in spec.wavelengths])
    fields = (torch.fft.ifft2(spectrum * phasor(passed, (math.exp(move) * axial).float())) for move in moves)
    return [_compared(squared_modulus(each[:, : shape[0], : shape[1]]), wanted, small) for each in fields]


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


def _is_amplitude(values: Tensor, back: Tensor) -> bool:
    """Whether values ``(C, H, W)`` are, in any unit, the amplitude of the target's light at the panel, ``back``."""
    if values.ndim == 4:
        return False
    pairs = [
        torch.stack([one.flatten(), light.flatten().abs()]).corrcoef() for one, light in zip(values, back, strict=True)
    ]
    return float(torch.stack(pairs).nanmean(0)[0, 1]) >= RIGHT  # a colour without light has none


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


def _fits(phase: Tensor, target: Tensor, spec: DisplaySpec, grain: int = FINE) -> dict[str, float]:
    """The correlation of amplitudes of image and target, mean over colours, by the pose of the file; empty where the
    target is even, or nearly so, in all colours. Of a panel of few levels, that of the phase or of its levels."""
    if not _structure(target, grain, FAINT).any():
        return {}
    shown = [nominal_levels(phase, spec)]
    shown += [phase] if shown[0] is not phase else []
    made = [_compared(ideal_light(each, spec), target, spec, grain) for each in shown]
    return {pose: max(float(fit[pose].mean()) for fit in made) for pose in made[0]}


def _compared(image: Tensor, target: Tensor, spec: DisplaySpec, grain: int = FINE) -> dict[str, Tensor]:
    """The correlation of amplitudes of an entire image plane ``(C, H, W)`` with the target, by pose: ``(C,)``, zero
    where the target is even, and so much more in other colours that the mean is theirs."""
    # The middle of a Fourier plane is a pixel, where that of an even number of them lies between two, and half a turn
    # about it is the opposite sign.
    moved = {axis: int(spec.plane == "fourier" and spec.shape[axis] % 2 == 0) for axis in (-2, -1)}
    poses = {name: image.flip(axes).roll([moved[axis] for axis in axes], axes) for name, axes in MIRRORED.items()}
    poses = {"": image} | {name: pose for name, pose in poses.items() if spec.plane != "fourier" or name != TURNED}
    if spec.shape[0] == spec.shape[1]:
        poses |= {f"transposed, {name}".removesuffix(", "): pose.mT for name, pose in poses.items()}
    wanted = _structure(target, grain, FAINT)
    wanted *= len(wanted) / wanted.any(1).sum().clamp_min(1)
    return {name: (_structure(spec.region.crop(pose), grain) * wanted).sum(1) for name, pose in poses.items()}


def _structure(image: Tensor, grain: int, faint: float = 0.0) -> Tensor:
    """Amplitudes ``(C, n)`` of an image ``(C, h, w)`` behind its speckle, of mean zero and norm one; zero where their
    contrast is at most ``faint``."""
    coarse = avg_pool2d(image[None], grain)[0].sqrt().flatten(1)
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
