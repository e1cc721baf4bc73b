"""What a method gets of a display: a handle that counts its captures and hides everything else."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Protocol

import torch
from torch import Tensor

from ..core.errors import BudgetError, CellError
from ..core.seeds import generator
from .account import Account, Journal
from .api import Camera, Capture, Display, DisplaySpec, Simulation, white_irradiance
from .phases import check_phase
from .traits import traits_of


class Solver(Protocol):
    """A method that knows the nominal optics alone."""

    def solve(self, target: Tensor, bench: Any) -> Tensor:
        """Linear intensity ``(B, C, h, w)`` to phase ``(B, C, H, W)`` [rad]."""


# A method, and what has it solve; the phases, from where they are kept or from there.
Known = Callable[[Solver, Callable[[], Tensor]], Tensor]


@dataclass(frozen=True)
class OpenLoop:
    """What a method has of a display that needs no camera: nominal optics, named random numbers, other methods' phases.

    target: ``(C, h, w)``, whose phases ``known`` gives from where phases are kept; None: nothing is kept.
    """

    spec: DisplaySpec
    generator: Callable[..., torch.Generator]
    target: Tensor
    known: Known | None

    def solved(self, method: Solver, target: Tensor) -> Tensor:
        """Phases ``(B, C, H, W)`` [rad] of targets ``(B, C, h, w)`` by another method that knows the nominal optics
        alone, such as where a method begins; solved once for all methods and displays that need them."""
        if self.known is None or len(target) > 1 or not torch.equal(target[0], self.target):
            return method.solve(target, self)
        return self.known(method, lambda: method.solve(target, self))


class MeteredDisplay:
    """All that a method may see of a display: nominal optics, a metered camera, what it learned, named random numbers.

    Everything else is private to the harness, its account of captures included.

    Parameters
    ----------
    display
        What the handle stands for.
    label
        Name of the method in error messages.
    target
        ``(C, h, w)`` linear light in [0, 1]; its device is that of the method.
    names
        What the random numbers and the noise of the captures depend on.
    method
        Who gets the handle; its ``camera`` and ``privileged`` decide what it may use.
    budget
        Captures that may be taken, None for no limit.
    learned
        What the method's ``prepare`` returned, None for a method that was not trained.
    starts
        Phases ``(C, H, W)`` [rad] of other methods for this target, for a privileged method to start from.
    target_name, target_sha256
        The target's name in its dataset and the digest of its source, empty where it has none.
    known
        Gives the phase of the target by another method, from where phases are kept; None: nothing is kept.
    journal
        Where its captures are counted beside those of other attempts, see ``Journal``.
    """

    def __init__(
        self,
        display: Display,
        label: str,
        target: Tensor,
        names: tuple[object, ...],
        method: object = None,
        budget: int | None = None,
        learned: Mapping[str, Any] | None = None,
        starts: Sequence[Tensor] = (),
        target_name: str = "",
        target_sha256: str = "",
        known: Known | None = None,
        journal: Journal | None = None,
    ) -> None:
        self._known = known
        self.target_name, self.target_sha256 = target_name, target_sha256
        self._display = display
        self._label = label
        self._target = target.clone()  # a method that writes to its target must not reach the scored one
        self._names = names
        traits = traits_of(method)
        self._camera, self._privileged = traits.camera, traits.privileged
        self._account = Account(label, budget, journal=journal)
        self._learned = learned
        self._starts = tuple(starts)
        self._kept: Tensor | None = None
        self._over = ""
        self._frames = set[str]()
        self.shown = 0

    def __repr__(self) -> str:
        most = "no limit" if self.budget is None else f"at most {self.budget}"
        return f"<display {self.spec.name} for {self._label}: {self.captures} captures, {most}>"

    @property
    def spec(self) -> DisplaySpec:
        """Nominal optics, public."""
        return self._display.spec

    @property
    def device(self) -> torch.device:
        """Where the target is, and with it all that a method computes."""
        return self._target.device

    @property
    def captures(self) -> int:
        """Captures taken so far, in this attempt."""
        return self._account.captures

    @property
    def budget(self) -> int | None:
        """Captures that the display allows in all, None for no limit; a method can plan its schedule for it."""
        return self._account.budget

    @property
    def kept(self) -> Tensor | None:
        """The best hologram so far, ``(C, H, W)`` [rad]: what the display scores if the budget ends. See ``keep``."""
        return self._kept

    @property
    def over(self) -> str:
        """Why the display refused a capture, empty if it refused none."""
        return self._over

    @property
    def learned(self) -> Mapping[str, Any]:
        """What the method's ``prepare`` returned. CellError for a method that declares no training."""
        if self._learned is None:
            raise CellError(f"{self._label} was not trained; a method that learns declares trains = True")
        return self._learned

    @property
    def light(self) -> Tensor:
        """Light at a white pixel, ``(C,)``, if all of the panel's went into the target; incident light is 1."""
        return white_irradiance(self._target, self.spec)

    @property
    def simulation(self) -> Simulation:
        """The bench itself, for privileged methods alone."""
        if not self._privileged:
            raise CellError(f"{self._label}: only a method that declares privileged = True may see the simulated bench")
        return self._display.simulation

    @property
    def starts(self) -> tuple[Tensor, ...]:
        """Phases ``(C, H, W)`` [rad] of other methods for this target; for a privileged method to start from."""
        if not self._privileged:
            raise CellError(f"{self._label}: only a method that declares privileged = True may see other holograms")
        return self._starts

    def solved(self, method: Solver, target: Tensor) -> Tensor:
        """The phases of targets by another method, see ``OpenLoop``."""
        return OpenLoop(self.spec, self.generator, self._target, self._known).solved(method, target)

    def generator(self, *names: object) -> torch.Generator:
        """Random numbers that depend on study seed, target, repeat and ``names``."""
        return generator("method", *self._names, *names)

    @cached_property
    def _opened_camera(self) -> Camera:
        return self._display.session((*self._names, "solve"), self._target)

    def capture(self, phase: Tensor) -> Capture:
        """Show a phase and photograph it; counted.

        Parameters
        ----------
        phase
            ``(C, H, W)`` [rad], any range; or frames ``(F, C, H, W)``, which share the exposure.

        Returns
        -------
        Capture
            The frame as the camera gives it; ``rectify`` brings it into the target's frame.

        Raises
        ------
        CellError
            The method declares no camera, or no display can show the phase.
        BudgetError
            No capture is left.
        """
        if not self._camera:
            raise CellError(f"{self._label} took a capture, but declares no camera (camera = True)")
        check_phase(phase, self.spec, self._label)
        camera = self._opened_camera  # before the capture is counted: to open it may take long, or fail
        try:
            self._account.take()
        except BudgetError as error:
            self._over = str(error)
            raise
        capture = camera.capture(phase)
        self.shown += len(phase) if phase.ndim == 4 else 1
        self._frames.add(_digest(capture))
        return capture

    def announce(self, phases: Sequence[Tensor]) -> None:
        """Tell the display which phases ``(C, H, W)`` [rad] are captured next, in that order, whatever they show.

        A bench whose photographs are taken elsewhere then asks for all of them at once; others need no notice.
        """
        if self._camera:
            self._opened_camera.announce(phases[: self._account.left()])

    def keep(self, phase: Tensor) -> None:
        """Hand in the best hologram so far, in the place of an earlier one.

        It is scored if ``capture`` then ends the solution with a BudgetError. A copy is kept.

        Parameters
        ----------
        phase
            ``(C, H, W)`` or ``(1, C, H, W)`` [rad], or frames ``(F, C, H, W)`` or ``(1, F, C, H, W)``.

        Raises
        ------
        CellError
            No display can show the phase.
        """
        hologram = phase[0] if phase.ndim > 3 and len(phase) == 1 else phase
        check_phase(hologram, self.spec, self._label)
        self._kept = hologram.detach().cpu().clone()

    def rectify(self, capture: Capture) -> Tensor:
        """A capture in the target's frame, ``(C, h, w)`` linear light; 1 is a white pixel at full efficiency.

        CellError for any other frame than ``capture`` has given: it would show where the camera stands, uncounted.
        """
        if _digest(capture) not in self._frames:
            raise CellError(f"{self._label}: rectify takes a frame as capture returned it; change it afterwards")
        return self._display.rectified(capture, self._target)


def _digest(capture: Capture) -> str:
    numbers = repr((capture.dark, capture.white, capture.gain)).encode()
    return hashlib.sha256(numbers + capture.frame.detach().cpu().numpy().tobytes()).hexdigest()


class MethodHandles:
    """What every display inherits: ``for_method``."""

    is_real: ClassVar[bool] = False

    def for_method(
        self: Display,
        method: object,
        label: str,
        target: Tensor,
        item: str,
        repeat: int,
        sha256: str = "",
        **given: Any,
    ) -> MeteredDisplay:
        """The handle that a method gets to solve a target.

        Parameters
        ----------
        method
            The method; its ``camera`` and ``privileged`` decide what the handle allows.
        label
            Its name in error messages.
        target
            ``(C, h, w)`` linear light in [0, 1].
        item, repeat
            Name of the target and number of the repetition: random numbers depend on them and on the display's seed.
        sha256
            Digest of the target's source.
        **given
            Budget, learned, starts, known, journal: see ``MeteredDisplay``.
        """
        names = (self.seed, item, repeat)
        return MeteredDisplay(self, label, target, names, method, target_name=item, target_sha256=sha256, **given)
