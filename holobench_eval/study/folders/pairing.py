"""Which channels of a capture are compared with its target, and captures that cannot be compared at all."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import adaptive_avg_pool2d

from ...imaging.warp import Warp
from .exposure import NAMES, levels, refusal, within
from .pictures import Picture, Values

LASER = 0.3  # of the strongest channel: what filters of a colour camera let through of a laser that is not theirs

SAVE_TARGET = "save the target as it was shown, in gray"  # ends what is refused by a fault of the target
UNKNOWN = f"which gray picture was shown is not known; {SAVE_TARGET}"
# Correlation of red less blue in a capture and its target: captures of simulated displays have 0.00 to 0.88 and real
# ones (Stanford 2021) 0.88 to 0.93, and with red and blue exchanged the negative of that.
EXCHANGED = -0.2
COARSE = 36  # averages a side, in which speckle weighs little
ALIKE = 0.5  # correlation of red and blue together, which an exchange leaves as it is; 0.78 in full speckle and haze
LIT = 0.05  # of the mean of the brightest channel: less is a colour that a target has not
COLOURFUL = 0.05  # of the mean of a channel: least contrast of red less blue in a target that can tell
NEARLY = "whose channels differ by a few levels of 255, as those of a gray picture that was saved as a JPEG in colour"


@dataclass(frozen=True)
class Pairing:
    """How a capture is compared with its target.

    channel: the one channel of the capture that is compared with a gray target, ``gray`` where all its channels are
    equal (empty: all channels, as they are); refused: why there is no comparison (empty: there is one).
    """

    channel: str = ""
    refused: str = ""

    @property
    def index(self) -> int | None:
        """The index of the capture's channel; None for all channels."""
        return NAMES.index(self.channel) if self.channel in NAMES else 0 if self.channel else None


def paired(capture: Picture, target: Picture) -> Pairing:
    """How a capture is compared with its target.

    A single laser in a colour photograph: one channel has the light, and the others have noise, which is no error of
    the hologram. Gray and colour go together where nothing is lost and nothing is guessed.
    """
    if capture.pixels_sha256 == target.pixels_sha256:
        return Pairing(refused="the capture is the target itself, value for value, and no photograph of it")
    laser = _single_laser(capture, target)
    pairs = ((name, capture.levels[own], target.levels[its]) for name, own, its in carrying(capture, target, laser))
    if too_few := refusal(pairs, aligned=False):
        return Pairing(refused=too_few)
    channel = "gray" if capture.gray else "" if laser is None else NAMES[laser]
    if laser is None and capture.shape[0] == target.shape[0] and (target.gray or not capture.gray):
        return Pairing()
    if channel and target.gray:
        return Pairing(channel)
    if channel:
        light = "is gray" if capture.gray else f"has light in its {channel} channel alone"
        fault = f"nearly gray, {NEARLY}; {SAVE_TARGET}" if target.nearly_gray else f"in colour: {UNKNOWN}"
        return Pairing(refused=f"the capture {light} and the target is {fault}")
    if capture.nearly_gray:
        return Pairing(refused=f"the target is gray and the capture nearly so, {NEARLY}; save the capture in gray")
    strongest = max(capture.structure)
    shares = [f"{value / strongest:.2f} in {name}" for name, value in zip(NAMES, capture.structure, strict=True)]
    return Pairing(
        refused="the capture is in colour and the target gray, and no channel has nearly all of the light "
        f"({', '.join(shares)} of the strongest; up to {LASER:g} is a single laser); save the channel that saw the "
        "display in gray"
    )


def lit(target: Picture) -> list[str]:
    """The colours in which a target is not black; of a gray one the first."""
    colours = zip(NAMES, target.structure, target.levels, strict=False)
    return [name for name, structure, levels in colours if structure or levels.top]


def too_few_levels(capture: Picture, target: Picture, frame: Values, shown: Values, warp: Warp) -> str:
    """Why a capture has too few levels where it shows its target; empty where it has enough.

    frame, shown: capture ``(C, Hs, Ws)`` and target ``(C, h, w)`` in the channels that are compared, which are one or
    all; warp: where the target lies on the capture.
    """
    compared = carrying(capture, target, None) if len(shown) > 1 else [("", 0, 0)]
    pairs = ((name, within(frame[own], warp), levels(shown[its])) for name, own, its in compared)
    return refusal(pairs, aligned=True)


def carrying(capture: Picture, target: Picture, laser: int | None) -> list[tuple[str, int, int]]:
    """The channels that have much of the target's light: name, index in the capture and index in the target.

    laser: the single channel of the capture that has light.
    """
    if laser is not None:
        return [("", laser, min(laser, target.shape[0] - 1))]
    if capture.shape[0] != target.shape[0] or len(target.structure) == 1:
        return [("", 0, 0)]
    least = LASER * max(target.structure)
    return [(name, c, c) for c, name in enumerate(NAMES) if target.structure[c] >= least]


def _single_laser(capture: Picture, target: Picture) -> int | None:
    """The channel of a colour photograph that has nearly all of the light that the target has; None: no single one."""
    wanted = target.structure if len(target.structure) == 3 else target.structure * 3
    if capture.gray or min(wanted) <= LASER * max(wanted):  # a target of one colour has its light in one channel itself
        return None
    seen = [own / of_target for own, of_target in zip(capture.structure, wanted, strict=True)]
    second, strongest = sorted(seen)[1:]
    return seen.index(strongest) if second <= LASER * strongest else None


def exchange(image: Tensor, reference: Tensor) -> str:
    """What is wrong where a capture ``(C, h, w)`` has the red of its target as blue and the reverse; empty elsewhere.

    Libraries differ in the order of colours, and nothing in a file tells one from the other.
    """
    if len(image) != 3:
        return ""
    pictures = [_coarse(each) for each in (image, reference)]
    means = [picture.mean((1, 2), keepdim=True).clamp_min(1e-12) for picture in pictures]
    if float(means[1][[0, 2]].min() / means[1].max()) < LIT:  # a leak into a colour that the target has not is nothing
        means = [mean.amax(0, keepdim=True).expand(3, -1, -1) for mean in means]
    (red, _, blue), (red_wanted, _, blue_wanted) = (each / mean for each, mean in zip(pictures, means, strict=True))
    seen, wanted = red - blue, red_wanted - blue_wanted
    contrast = float(wanted.std())
    if contrast < COLOURFUL or _correlation(red + blue, red_wanted + blue_wanted) < ALIKE:  # gray, or another picture
        return ""
    correlation = _correlation(seen, wanted)
    # Noise and a leak's own curve may correlate, but are small beside red less blue of the target.
    if correlation >= EXCHANGED or correlation * float(seen.std()) / contrast >= EXCHANGED:
        return ""
    poses = [turned for side in (seen, seen.T) for turned in (side, side.flip(0), side.flip(1), side.flip(0, 1))]
    if any(_correlation(pose, wanted) > -correlation for pose in poses if pose.shape == wanted.shape):
        return ""  # turned or mirrored, and not exchanged
    return (
        f"red and blue are exchanged in the capture or in its target (their difference correlates by {correlation:.2f})"
        "; save the wrong one with red first"
    )


def _coarse(image: Tensor) -> Tensor:
    """A picture ``(3, h, w)`` averaged over speckle."""
    rows, columns = (min(COARSE, side) for side in image.shape[1:])
    return adaptive_avg_pool2d(image[None], (rows, columns))[0]


def _correlation(first: Tensor, second: Tensor) -> float:
    """That of two pictures; 0 where one of them is even."""
    return float(torch.stack([first.flatten(), second.flatten()]).corrcoef()[0, 1].nan_to_num())
