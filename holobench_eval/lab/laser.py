"""Lasers: which colour is on, by a user's command or function, or by asking the user."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Protocol

from annotated_types import Interval

from ..core.errors import UserError
from .devices import DeviceError
from .drivers.driver import load, located


@dataclass(frozen=True)
class LaserSettings:
    """How the lasers are switched (``laser:`` of a bench file); a bench with one wavelength needs none.

    command: a program and its arguments, without a shell, where ``{channel}`` stands for 0, 1, 2 or ``off``; or
    callable: ``path/to/file.py:function`` or ``module:function``, called with 0, 1, 2 or None; channels are counted
    as ``panel.wavelengths`` lists them. Both return when the light is steady. timeout [s]: of the command.
    """

    command: tuple[str, ...] = ()
    callable: str = ""
    timeout: Annotated[float, Interval(gt=0, le=600)] = 10.0


class Laser(Protocol):
    """The light source of a bench."""

    def select(self, channel: int | None) -> None:
        """Put this channel on and all others off; None: all off. Returns when it is so; DeviceError otherwise."""

    def close(self) -> None:
        """Leave it as a bench without a user should be."""


def laser(settings: LaserSettings | None, channels: int, folder: Path, ask: Callable[[str], None]) -> Laser:
    """The laser of a bench.

    folder: where a relative path of ``callable`` starts, and the command runs; ask: says a line to the user and
    returns when it is done, for a laser that nobody can switch. UserError for settings that cannot work.
    """
    if settings is None:
        if channels > 1:
            raise UserError(f"laser: {channels} wavelengths need 'command' or 'callable' to switch between them")
        return SteadyLaser(ask)
    if bool(settings.command) == bool(settings.callable):
        raise UserError("laser: give either 'command' or 'callable'")
    if settings.callable:
        return SwitchedLaser(settings.callable, load(located(settings.callable, folder), "laser.callable"))
    if not any("{channel}" in part for part in settings.command):
        raise UserError("laser.command: one argument must hold {channel}, which stands for 0, 1, 2 or off")
    return SwitchedLaser(settings.command[0], partial(_run, settings.command, settings.timeout, folder))


@dataclass
class SteadyLaser:
    """One laser that is always on; the user blocks its beam where darkness is needed."""

    ask: Callable[[str], None]
    blocked: bool = False

    def select(self, channel: int | None) -> None:
        """Ask for the beam to be blocked or opened, where it is not."""
        if self.blocked != (channel is None):
            self.ask("block the laser beam" if channel is None else "open the laser beam again")
            self.blocked = channel is None

    def close(self) -> None:
        """Nothing to do."""


@dataclass(frozen=True)
class SwitchedLaser:
    """Calls a function for every change of the channel: a user's, or one that runs a user's program."""

    name: str
    function: Callable[[int | None], object]

    def select(self, channel: int | None) -> None:
        """Call it. DeviceError with whatever it raises."""
        try:
            self.function(channel)
        except DeviceError:
            raise
        except Exception as error:
            raise DeviceError(f"laser: {self.name}({channel}): {type(error).__name__}: {error}") from error

    def close(self) -> None:
        """Switch off."""
        self.select(None)


def _run(command: Sequence[str], timeout: float, folder: Path, channel: int | None) -> None:
    """Run a program, without a shell. DeviceError when it fails, is not there, or takes longer than its time."""
    word = "off" if channel is None else str(channel)
    program, *arguments = (part.replace("{channel}", word) for part in command)
    try:
        done = subprocess.run(
            [program, *arguments],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=timeout,
        )
    except subprocess.TimeoutExpired:
        raise DeviceError(f"laser: '{program}' takes longer than {timeout:g} s") from None
    except (OSError, ValueError) as error:
        raise DeviceError(f"laser: '{program}' does not run: {error}") from error
    if done.returncode:
        answer = (done.stderr.strip() or done.stdout.strip() or "without a word").splitlines()[-1]
        raise DeviceError(f"laser: '{program}' ended with {done.returncode} for channel {word}: {answer[:200]}")
