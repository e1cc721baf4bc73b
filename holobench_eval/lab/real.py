"""A real bench as a display: its photographs registered, in the target's frame and in the harness's unit of light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import torch
from torch import Tensor

from ..core.errors import CellError
from ..display.api import (
    DARKEST_MEAN,
    Capture,
    DisplaySpec,
    Exposure,
    RectifiedCapture,
    Simulation,
    efficiency,
    in_target_frame,
    white_irradiance,
)
from ..display.metered import MethodHandles
from ..display.phases import check_phase
from ..imaging.cross_check import disagreement, second_warp
from ..imaging.grid import fiducial
from ..imaging.register import Registration, register
from ..imaging.shared_pose import sampled
from ..methods.fiducials import fiducial_phases
from ..optics.phase import blaze
from .photograph import MOST_SATURATED, Photograph, Photographer, Request

BRIGHTER = 100.0
"""Most that matched brightness may change an exposure time."""


@dataclass(frozen=True)
class RealBench(MethodHandles):
    """A panel and a camera that exist.

    spec: nominal optics; carrier: (vertical, horizontal) cycles per pixel of a blaze that is added to every phase;
    residual_bound: largest registration residual [region px, rms] with which a study may run; seed: of the study.
    """

    spec: DisplaySpec
    photographer: Photographer
    carrier: tuple[float, float]
    residual_bound: float
    seed: int

    is_real: ClassVar[bool] = True

    @property
    def simulation(self) -> Simulation:
        """There is none: nobody can look into a real bench."""
        raise CellError("a real bench cannot be looked into; this method needs a simulated one")

    @cached_property
    def _grid_requests(self) -> list[Request]:
        phases = fiducial_phases(self, self._grid_target)
        return [Request(self.shown(phase), 1.0, "fiducial", (index,)) for index, phase in enumerate(phases.values())]

    @cached_property
    def _grid_target(self) -> Tensor:
        return fiducial(self.spec.region.shape).image.float().expand(len(self.spec.wavelengths), -1, -1)

    def announce_grid(self) -> None:
        """Ask for the holograms of the fiducial grid, which every study needs."""
        self.photographer.announce(self._grid_requests)

    @cached_property
    def grid_photograph(self) -> Tensor:
        """Mean photograph ``(C, Hs, Ws)`` of the holograms of the fiducial grid, in the photographer's unit."""
        self.announce_grid()
        lights = [self.photographer.photograph(request).light for request in self._grid_requests]
        return torch.stack(lights).mean(0)

    @cached_property
    def registration(self) -> Registration:
        """Camera geometry from circle-grid holograms (protocol, step 2). CellError when it cannot be trusted."""
        return register(self.grid_photograph, fiducial(self.spec.region.shape), self.residual_bound)

    @cached_property
    def second_registration(self) -> Registration | None:
        """The geometry as another algorithm finds it in the same photograph; None where it finds none."""
        grid = fiducial(self.spec.region.shape)
        frames = self.grid_photograph.cpu().numpy()
        found = [
            second_warp(frame, grid.image.numpy(), warp)
            for frame, warp in zip(frames, self.registration.warps, strict=True)
        ]
        warps = tuple(warp for warp in found if warp is not None)
        return Registration(warps, self.registration.residual) if len(warps) == len(found) else None

    @property
    def disagreement(self) -> float:
        """Largest distance [region px] at a corner between both geometries; NaN without a second one."""
        if self.second_registration is None:
            return float("nan")
        pairs = zip(self.registration.warps, self.second_registration.warps, strict=True)
        return max(disagreement(first, second) for first, second in pairs)

    @cached_property
    def unit(self) -> tuple[float, ...]:
        """The photographer's light that stands for the mean incident light on the panel, per channel.

        Chosen so that the holograms of the grid are as bright as the nominal model says: a real camera does not tell
        how much light the panel gets, so an efficiency of 1 means the nominal one.
        """
        measured = self.registration.rectify(self.grid_photograph).mean((-2, -1))
        predicted = torch.stack([self._predicted(request.phase) for request in self._grid_requests]).mean(0)
        if not bool((measured > 0).all()):
            raise CellError("the photographs of the fiducial grid are not brighter than the dark ones")
        return tuple((measured / predicted).tolist())

    def _predicted(self, phase: Tensor) -> Tensor:
        """Mean light ``(C,)`` in the region by the nominal model; incident light is 1."""
        plain = phase - blaze(self.spec.shape, self.carrier)
        fields = [self.spec.propagator(c).forward(torch.polar(torch.ones_like(p), p)) for c, p in enumerate(plain)]
        return torch.stack([self.spec.region.crop(field.abs().square()).mean() for field in fields])

    def shown(self, phase: Tensor) -> Tensor:
        """The phase ``(C, H, W)`` or frames ``(F, C, H, W)`` [rad] that the panel gets: with the blaze of the bench."""
        frames = phase[0] if phase.ndim == 4 and len(phase) == 1 else phase
        return frames.cpu() + blaze(self.spec.shape, self.carrier)

    def relative_exposure(self, target: Tensor) -> float:
        """Exposure time for a target ``(C, h, w)``, relative to that for the fiducial grid, from the target alone."""
        ratio = white_irradiance(self._grid_target, self.spec) / white_irradiance(target.cpu(), self.spec)
        return float(f"{float(ratio.min()):.3g}")

    def session(self, names: tuple[object, ...], target: Tensor) -> RealSession:
        """The camera, exposed for ``target``; names tell its photographs from others of the same phase."""
        return RealSession(self, names, self.relative_exposure(target))

    def capture(self, photo: Photograph) -> Capture:
        """A photograph as a capture."""
        return Capture(photo.light, dark=0.0, white=float("inf"), gain=self.unit)

    def photograph(
        self, phase: Tensor, target: Tensor, item: str, repeat: int, exposure: Exposure = "equal", label: str = ""
    ) -> RectifiedCapture:
        """See ``Display.photograph``; the image has the means over the target's pixels, as ``holoeval score`` has."""
        check_phase(phase, self.spec, label)
        names, relative = (self.seed, item, repeat, "score"), self.relative_exposure(target)
        if exposure == "matched":
            metering = Request(self.shown(phase), relative, "hologram", (*names, "metering"), item)
            metered = self.rectified(self.capture(self.photographer.photograph(metering)), target)
            wanted = target.mean((-2, -1))
            ratio = (wanted / metered.mean((-2, -1)).clamp_min(1e-3))[wanted > DARKEST_MEAN]
            brighter = float(ratio.min().clamp(1 / BRIGHTER, BRIGHTER)) if len(ratio) else 1.0
            relative = float(f"{relative * brighter:.3g}")
        request = Request(self.shown(phase), relative, "hologram", names, item)
        self.photographer.announce([request])
        registered = self.registration
        photo = self.photographer.photograph(request)
        image = self._averaged(self.capture(photo), target, registered)
        return RectifiedCapture(
            image=image,
            capture=self.capture(photo),
            saturated=photo.saturated,
            efficiency=efficiency(image, target),
            residual=max(registered.residual),
            exposure=photo.exposure,
        )

    def rectified(self, capture: Capture, target: Tensor) -> Tensor:
        """See ``Display.rectified``: samples at the target's pixels, as the nominal model of the methods gives them."""
        return in_target_frame(capture, target, self.spec, self.registration)

    def _averaged(self, capture: Capture, target: Tensor, registration: Registration) -> Tensor:
        """As ``rectified``, but with means over the area of the target's pixels where the camera's are finer."""
        frames = zip(capture.linear().cpu().numpy(), registration.warps, strict=True)
        light = torch.stack([torch.from_numpy(sampled(frame[None], warp)[0]) for frame, warp in frames])
        return light.to(target.device) / white_irradiance(target, self.spec)[:, None, None]

    def second_image(self, shot: RectifiedCapture, target: Tensor) -> Tensor | None:
        """``RectifiedCapture.image`` by the second geometry; None where there is none."""
        second = self.second_registration
        return None if second is None else self._averaged(shot.capture, target, second)


@dataclass
class RealSession:
    """Photographs in the name of a solution or a training, numbered."""

    bench: RealBench
    names: tuple[object, ...]
    exposure: float
    frames: int = field(default=0)

    def announce(self, phases: Sequence[Tensor]) -> None:
        """Tell which phases ``(C, H, W)`` or ``(F, C, H, W)`` [rad] are captured next."""
        self.bench.photographer.announce([self._request(phase, index) for index, phase in enumerate(phases)])

    def capture(self, phase: Tensor) -> Capture:
        """Show ``phase`` ``(C, H, W)`` or ``(F, C, H, W)`` [rad] and photograph it. CellError where it saturates."""
        request = self._request(phase, 0)
        self.bench.photographer.announce([request])
        self.frames += 1
        photo = self.bench.photographer.photograph(request)
        if photo.saturated > MOST_SATURATED:
            raise CellError(f"{photo.saturated:.2%} of a capture is saturated, more than {MOST_SATURATED:.1%}")
        return self.bench.capture(photo)

    def _request(self, phase: Tensor, ahead: int) -> Request:
        shown = self.bench.shown(phase.detach())
        return Request(shown, self.exposure, "hologram", (*self.names, self.frames + ahead))
