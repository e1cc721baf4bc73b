"""A live bench as a photographer: panel, camera, lasers and capture settings, one photograph after the other."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import torch
from torch import Tensor

from ..core.errors import CellError, LostDeviceError, UserError
from ..imaging.convention import Convention
from .bench_file import CaptureSettings
from .dark import Dark, given_dark
from .devices import Camera, DeviceError, SequenceSlm, Slm
from .exposure import FreshCamera, auto_exposure, averaged, combined, dark_frames, refuse_late, refuse_miscounted
from .laser import Laser
from .photograph import Photograph, Request, plane_of
from .preflight import Check, full_turn, linearity, phase_sign
from .settle import PATIENCE, Toggle, refuse_old, settle_time

DARK_SPAN = 1 / 8, 2.0  # of the exposures in use: between these, dark counts are measured, beyond extrapolated
TRIES = 2  # of every photograph, since drivers drop a frame now and then


@dataclass(frozen=True, eq=False)
class Prepared:
    """What `Rig.prepare` measured.

    exposures [s], which a request's are relative to, and counts without light: per channel; settle [s].
    """

    exposures: tuple[float, ...]
    darks: tuple[Dark, ...]
    settle: float


class Rig:
    """A `Photographer` that owns its devices.

    wavelengths [m]: one for each colour channel, in the order of the phases. Of a colour camera's three planes each
    channel takes the one that its wavelength is for (blue below 490 nm, red above 580), and the others are not
    looked at. wait: how to pass seconds.
    """

    def __init__(
        self,
        slm: Slm,
        camera: Camera,
        convention: Convention,
        settings: CaptureSettings,
        wavelengths: Sequence[float],
        laser: Laser,
        wait: Callable[[float], None] = time.sleep,
    ) -> None:
        self.slm, self.camera, self.convention, self.settings = slm, camera, convention, settings
        self.laser, self.wait = laser, wait
        self._fresh = FreshCamera(camera)
        self.planes = tuple(plane_of(wavelength) for wavelength in wavelengths)
        self.prepared: Prepared | None = None
        self._failures = 0
        settings.exposures(len(self.planes))  # refuses a wrong number before a device moves

    def announce(self, requests: Sequence[Request]) -> None:
        """Nothing: every phase is shown when its photograph is asked for."""

    def photograph(self, request: Request) -> Photograph:
        """Show a phase and photograph it, channel by channel; see `Photographer`.

        The camera's limits cut exposures off, which changes noise and saturation but not the light, in counts per
        second. CellError for a phase that the panel cannot show, and where a device fails twice; `LostDeviceError`
        where that happens to two photographs in a row, or the camera gives no frame at all.
        """
        ready = self.prepared
        if ready is None:
            raise UserError("the bench takes no photographs before it has been prepared and has passed its gates")
        self._check_phase(request.phase)
        for _ in range(TRIES):
            try:
                taken = self._take(request, self.convention, ready, self.settings)
            except DeviceError as error:
                fault = str(error)
            else:
                self._failures = 0
                return taken
        self._failures += 1
        with suppress(DeviceError):
            self.camera.expose(self.camera.exposures[0])  # whether it still gives a frame
            if self._failures < 2:
                raise CellError(f"no photograph: {fault}")
        raise LostDeviceError(
            f"the bench does not answer any more: {fault}; mend it, and run again with --retry-failed"
        )

    def prepare(self, pattern: Request, say: Callable[[str], None]) -> Prepared:
        """Exposure, settling time, dark frames, linearity, phase convention, in this order, one line each.

        pattern: the hologram that `preflight.phase_sign` wants. Its relative exposure fixes what exposures are relative
        to: those that are right for it, divided by that. Raises UserError, in one line, for a device that fails and for
        a check that is not passed.
        """
        self._check_phase(pattern.phase)
        try:
            longest = PATIENCE if self.settings.settle == "auto" else self.settings.settle
            self._show(pattern.phase, 0, self.convention, longest)
            refuse_late(self.camera, self.planes[0])
            exposures = tuple(self._exposure(pattern, channel, longest) for channel in range(len(self.planes)))
            say(f"exposure: {', '.join(f'{seconds:.3g} s' for seconds in exposures)}")
            settle = self._settle(pattern.phase, exposures[0] * pattern.relative_exposure)
            say(f"settling: {settle * 1e3:.0f} ms{'' if self.settings.settle == 'auto' else ' (as set)'}")
            darks = self._darks(exposures)
            counts = [float(np.mean(dark.at(each))) for dark, each in zip(darks, exposures, strict=True)]
            level = ", ".join(f"{each:.1f}" for each in counts)
            say(f"dark: {level} counts{'' if self.settings.dark_frames else ' (as set)'}")
            ready = Prepared(exposures, darks, settle)
            for check in self._checks(pattern, ready):
                if not check.passed:
                    raise UserError(check.line)
                say(check.line)
        except DeviceError as error:
            raise UserError(f"the bench is not ready: {error}") from error
        self.prepared = ready
        return ready

    def close(self) -> None:
        """Lasers off, devices given back."""
        with suppress(DeviceError):  # the devices have to be given back all the same
            self.laser.close()
        try:
            self.slm.close()
        finally:
            self.camera.close()

    def _exposure(self, pattern: Request, channel: int, settle: float) -> float:
        self._show(pattern.phase, channel, self.convention, settle)
        given, plane = self.settings.exposures(len(self.planes)), self.planes[channel]
        seconds = given[channel] if given else auto_exposure(self.camera, plane) / pattern.relative_exposure
        refuse_miscounted(self.camera, seconds * pattern.relative_exposure, plane)
        return seconds

    def _settle(self, phase: Tensor, seconds: float) -> float:
        self.laser.select(0)
        bright, dark = (self.convention.of(0).levels(each) for each in (phase[0], torch.zeros_like(phase[0])))
        toggle = Toggle(
            show=lambda lit: self.slm.show(bright if lit else dark),
            take=lambda: averaged(self.camera, seconds, 1, self.planes[0]).counts,
            wait=self.wait,
        )
        if self.settings.settle == "auto":
            return settle_time(toggle)
        refuse_old(toggle, self.settings.settle)
        return self.settings.settle

    def _darks(self, exposures: Sequence[float]) -> tuple[Dark, ...]:
        if self.settings.dark is not None:
            dark, _ = given_dark(self.settings.dark)
            dark.refuse_other_scale(self.camera.white)
            return tuple(dark.plane(plane) for plane in self.planes)
        self.laser.select(None)
        least, darks = min(self.settings.hdr), []
        for seconds, plane in zip(exposures, self.planes, strict=True):
            span = (seconds * least * DARK_SPAN[0], seconds * DARK_SPAN[1])
            darks.append(dark_frames(self.camera, self.settings.dark_frames, span, plane))
        return tuple(darks)

    def _checks(self, pattern: Request, ready: Prepared) -> Iterator[Check]:
        for channel, (seconds, dark, plane) in enumerate(zip(ready.exposures, ready.darks, self.planes, strict=True)):
            self._show(pattern.phase, channel, self.convention, ready.settle)
            take = partial(averaged, self.camera, count=self.settings.average, plane=plane)
            check = linearity(take, seconds * pattern.relative_exposure, dark)
            yield replace(check, line=f"channel {channel}: {check.line}") if len(self.planes) > 1 else check
        single = replace(self.settings, average=1, hdr=(1.0,))  # many photographs, of which none is scored

        def show(phase: Tensor, convention: Convention) -> Tensor:
            return self._take(replace(pattern, phase=phase), convention, ready, single).light

        yield phase_sign(show, pattern.phase, self.convention)
        if self.convention.out_of_reach:
            yield Check(True, self.convention.out_of_reach)
        yield full_turn(show, pattern.phase, self.convention)

    def _take(self, request: Request, convention: Convention, ready: Prepared, settings: CaptureSettings) -> Photograph:
        frames, lost, seconds = [], [], []
        for channel, (exposure, dark) in enumerate(zip(ready.exposures, ready.darks, strict=True)):
            self._show(request.phase, channel, convention, ready.settle)
            wanted, plane = exposure * request.relative_exposure, self.planes[channel]
            bracket = [averaged(self._fresh, wanted * each, settings.average, plane) for each in settings.hdr]
            light, saturated = combined(bracket, dark)
            frames.append(light)
            lost.append(saturated)
            seconds.append(max(each.seconds for each in bracket))
        stacked = torch.from_numpy(np.stack(frames).astype(np.float32))
        return Photograph(stacked, float(np.mean(lost)), tuple(seconds))

    def _show(self, phase: Tensor, channel: int, convention: Convention, settle: float) -> None:
        self.laser.select(channel)
        levels = convention.of(channel).levels(phase[..., channel, :, :])
        self._fresh.changed((channel, levels.tobytes()), self.planes[channel])
        if phase.ndim == 3:
            self.slm.show(levels)
        elif isinstance(self.slm, SequenceSlm):
            self.slm.show_sequence(list(levels))
        else:
            raise CellError(f"{self.slm.name} shows one pattern an exposure, not {len(phase)} frames")
        self.wait(settle)

    def _check_phase(self, phase: Tensor) -> None:
        wanted = (len(self.planes), *self.slm.shape)
        if phase.ndim not in (3, 4) or tuple(phase.shape[-3:]) != wanted:
            raise CellError(f"phase is {tuple(phase.shape)}, but {self.slm.name} with its wavelengths shows {wanted}")
        if not phase.is_floating_point() or not bool(torch.isfinite(phase).all()):
            raise CellError("phase holds values that are no finite real numbers; the panel cannot show it")
