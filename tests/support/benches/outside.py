"""Displays with effects that no stage of the package has, for tests of what is learned from photographs.

A model in the form of the stages fits a bench of theirs by construction, and none of these. Each is a bench like
``leto-aged`` with two or three faults more. Where it is not ``installed``, the same profile is its base: the bench with
the same random patterns and without the faults. ``Flicker.ripple`` has no effect here.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import torch
from torch import Tensor

from holobench_eval.core.device import CPU
from holobench_eval.display import Profile, load_profile
from holobench_eval.display.simulated.geometry import Geometry
from holobench_eval.display.simulated.panel_light import PanelLight
from holobench_eval.display.simulated.path import LightPath
from holobench_eval.display.simulated.pipeline import ChannelMaps, SimulatedBench, seen
from holobench_eval.display.simulated.stages import LookUpTable
from holobench_eval.display.simulated.stages.panel import straight_through_level
from holobench_eval.optics.phase import TAU
from holobench_eval.optics.phasor import squared_modulus
from holobench_eval.study import opening

TURNS = 3  # of the drive of a panel without levels of its own; the middle one is used, so that phases may leave it


class Outside(SimulatedBench):
    """A bench whose phase may be driven, and whose light may be seen, in another way than by the stages."""

    def __init__(self, profile: Profile, device: torch.device = CPU) -> None:
        super().__init__(profile, device)
        self.panels = [[_without_levels(maps.light) for maps in lines] for lines in self.lines]

    def intensity(self, phase: Tensor, channel: int, flicker: float = 1.0) -> Tensor:
        """See ``SimulatedBench``."""
        level, lights = straight_through_level(phase + self.channels[channel].light.added, self.spec.bits), []
        for maps, panel in zip(self.lines[channel], self.panels[channel], strict=True):
            drives = self.drives(level, maps.light, flicker * self.drift_gain)
            lights += [self.seen(maps, panel, level, (drive + TAU) / TURNS) / len(drives) for drive in drives]
        return torch.stack(lights).sum(0)

    def drives(self, level: Tensor, light: PanelLight, gain: float) -> list[Tensor]:
        """Phases [rad] ``(H, W)`` that pixels of these gray levels have at moments of an exposure."""
        return [light.lut.phase(level, light.bits, light.lut_gain * gain, light.channel, light.lut_bend)]

    def seen(self, maps: ChannelMaps, panel: PanelLight, level: Tensor, drive: Tensor) -> Tensor:
        """Light at the image plane, of a panel that is driven as it is; drive [rad / TURNS]."""
        return seen(maps.path, panel, drive, 1.0)


class Strange(Outside):
    """A ripple that depends on level and row, a table whose S-shape varies over the panel, and a ghost.

    RIPPLE [rad, peak]: pulses of a digital addressing move the phase while the camera exposes (Lizana et al. 2010, Opt.
    Express 18, 10581); size, the most at middle levels, and the last row a period behind the first: assumed.
    ``Flicker.ripple`` is one relative gain for the whole panel.
    SHAPE [rad, rms over the panel]: of ``g (1 - g) (1 - 2 g)`` in units of its height. A common table with a map of
    gains does not describe a panel whose drive is uneven (Engstrom et al. 2013, Opt. Express 21, 16086); size assumed.
    GHOST [share], AT [panel heights]: the rear of a plate beam splitter at 45 degrees reflects 9 % of s-polarised light
    (Fresnel, n = 1.5), and half of it twice passes the front: 4.6 % of the picture, 0.76 mm aside for 1 mm of glass.
    Its longer way is beyond the coherence of a diode of 1 nm, so that its light adds in intensity.
    """

    RIPPLE, MOMENTS, SHAPE, GHOST, AT = 0.3, 3, 0.15, 0.04, (0.02, 0.11)

    def __init__(self, profile: Profile, device: torch.device = CPU) -> None:
        super().__init__(profile, device)
        geometry = self.channels[0].geometry
        self.shape = (self.SHAPE * geometry.smooth_map(1.5, "shape of the table")).float().to(device)
        self.lag = (TAU * geometry.coordinates()[0]).float().to(device)

    def drives(self, level: Tensor, light: PanelLight, gain: float) -> list[Tensor]:
        """At ``MOMENTS`` equal steps of the period of the ripple."""
        (smooth,), g = super().drives(level, light, gain), level / 2**self.spec.bits
        still = smooth + self.shape * (g * (1 - g) * (1 - 2 * g) * 6 * math.sqrt(3))
        ripple, times = self.RIPPLE * 4 * g * (1 - g), (TAU * step / self.MOMENTS for step in range(self.MOMENTS))
        return [still + ripple * torch.sin(time + self.lag) for time in times]

    def integrated(self, phase: Tensor, channel: int, flicker: float = 1.0) -> Tensor:
        """With the ghost, which takes its light from the picture."""
        light = super().integrated(phase, channel, flicker)
        down, right = (round(place * self.image_samples * self.spec.shape[0]) for place in self.AT)
        beside = torch.nn.functional.pad(light, (right, -right, down, -down))
        return (1 - self.GHOST) * light + self.GHOST * beside


class Coupled(Outside):
    """Pixels that depend on their row, and on one neighbour more than on the other, and that dim where they are driven.

    ROW: share of the difference between a row's mean phase and the panel's that its pixels take on over the electrode
    that they have in common, as rows of active-matrix displays do; size assumed.
    ONE_SIDED: share of a step up to the left neighbour that a pixel takes on; it takes on none of a step down. Fields
    across an edge add to the pretilt on one side and oppose it on the other (three-dimensional directors: Moser et al.
    2019, Opt. Express 27, 25046); size assumed. ``Crosstalk`` is even and linear.
    ABSORBED, DEPOLARISED: of the modulated amplitude, from the ends of the stroke to its middle, about the mean that
    the exposure was set for, and at a step of a full turn, where the director leaves its plane. Panels for phase alone
    dim by some per cent when polarisation and director are not quite parallel (Jones); sizes assumed.
    """

    ROW, ONE_SIDED, ABSORBED, DEPOLARISED = 0.05, 0.2, 0.1, 0.1

    def drives(self, level: Tensor, light: PanelLight, gain: float) -> list[Tensor]:
        """With what rows and left neighbours add."""
        (own,) = super().drives(level, light, gain)
        row, edge = own.mean(1, keepdim=True) - own.mean(), (_left(own) - own).clamp_min(0)
        return [own + self.ROW * row + self.ONE_SIDED * edge]

    def seen(self, maps: ChannelMaps, panel: PanelLight, level: Tensor, drive: Tensor) -> Tensor:
        """Of modulated light that is dimmed pixel by pixel; what is not modulated stays."""
        g, step = level / 2**self.spec.bits, (_left(drive) - drive) * (TURNS / TAU)
        loss = self.ABSORBED * (4 * g * (1 - g) - 2 / 3) + self.DEPOLARISED * step.square()
        field, still = panel.field(drive, 1.0), panel.unmodulated * panel.incident
        return squared_modulus(maps.path.forward(field - loss * (field - still)))


class Tilted(Outside):
    """A picture that is curved and askew, with light of the other polarisation, before a camera that smears.

    FOCUS [waves rms at 517 nm]: of defocus at the corners, of which the share TILT is odd along the rows, since the
    camera stands askew, and the rest grows with the square of the distance from the axis: an achromat of 50 mm has a
    Petzval radius of about -1.4 f, 0.35 mm of sag at 7 mm, 0.1 waves in a cone of 0.032. Linear between three planes.
    CROSSED: share of the power in the polarisation that the panel does not modulate, with no analyser behind it: sin^2
    of 10 degrees, twice the error of a half-wave plate (Malus). Unlike ``ZeroOrder`` it does not interfere.
    SMEAR: share of a column's mean light that its pixels gather while charge is shifted, transfer over exposure: 0.4 ms
    of 20 ms of a frame-transfer sensor without a shutter (PVCAM manual of Photometrics, CCD image smear).
    """

    FOCUS, TILT, CROSSED, SMEAR = 0.1, 0.5, 0.03, 0.02

    def __init__(self, profile: Profile, device: torch.device = CPU) -> None:
        super().__init__(profile, device)
        self.planes = {maps.geometry: self._planes(maps.geometry) for lines in self.lines for maps in lines}
        down, right = (torch.linspace(-1, 1, self.image_samples * side, device=device) for side in self.spec.shape)
        self.defocus = (1 - self.TILT) * (down[:, None].square() + right.square()) / 2 + self.TILT * right
        self.crossed = [torch.stack([*map(self._crossed, lines)]).sum(0) for lines in self.lines]

    def _planes(self, geometry: Geometry) -> list[LightPath]:
        """The ways to the planes before and behind the picture."""
        way, given = self.profile.propagation, self.profile.propagation.aberration
        moved = ({**given, "defocus": given.get("defocus", 0.0) + move} for move in (-self.FOCUS, self.FOCUS))
        ways = (replace(self.profile, propagation=replace(way, aberration=each)) for each in moved)
        return [self._path(each, geometry) for each in ways]

    def _crossed(self, maps: ChannelMaps) -> Tensor:
        still = maps.light.incident.expand(self.samples, self.samples, *self.spec.shape).contiguous()
        return squared_modulus(maps.path.forward(still))

    def seen(self, maps: ChannelMaps, panel: PanelLight, level: Tensor, drive: Tensor) -> Tensor:
        """Of the field that the planes around each place have."""
        field, w, (before, behind) = panel.field(drive, 1.0), self.defocus, self.planes[maps.geometry]
        near, middle, far = (path.forward(field) for path in (before, maps.path, behind))
        return squared_modulus((1 - w.abs()) * middle + w.clamp_min(0) * far - w.clamp_max(0) * near)

    def intensity(self, phase: Tensor, channel: int, flicker: float = 1.0) -> Tensor:
        """With the crossed light."""
        return (1 - self.CROSSED) * super().intensity(phase, channel, flicker) + self.CROSSED * self.crossed[channel]

    def integrated(self, phase: Tensor, channel: int, flicker: float = 1.0) -> Tensor:
        """Smeared down the columns."""
        light = super().integrated(phase, channel, flicker)
        return light + self.SMEAR * light.mean(0)


NAMES: dict[str, type[Outside]] = {"strange": Strange, "coupled": Coupled, "tilted": Tilted}


def profile(name: str, folder: Path, seed: int = 11) -> Profile:
    """The profile of a display of ``NAMES``, written into a folder as ``NAME.yaml``."""
    about, path = str(NAMES[name].__doc__).splitlines()[0], folder / f"{name}.yaml"
    path.write_text(f"like: leto-aged\nname: {name}\nversion: 1\nseed: {seed}\ndescription: {about}\n")
    return load_profile(str(path))


@contextmanager
def installed() -> Iterator[None]:
    """``open_bench`` builds the class of ``NAMES`` for a profile of its name, in this process; nothing opened stays."""
    build = lambda given, *device: NAMES.get(given.name, SimulatedBench)(given, *device)  # noqa: E731
    with patch.object(opening, "_open", type(opening._open)()), patch.object(opening, "SimulatedBench", build):
        yield


def _without_levels(light: PanelLight) -> PanelLight:
    """A panel driven over ``TURNS`` turns in 65,536 steps in the place of levels and table; with its crosstalk."""
    gain = torch.full_like(light.lut_gain, TURNS)
    return replace(light, bits=16, lut=LookUpTable(), added=torch.zeros_like(light.added), lut_gain=gain, lut_bend=None)


def _left(phase: Tensor) -> Tensor:
    """What the left neighbour of each pixel has; pixels of the first column are their own."""
    return torch.cat([phase[:, :1], phase[:, :-1]], 1)
