"""What a camera gave of one hologram, in linear light, and who can be asked for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from torch import Tensor

MOST_SATURATED = 0.001  # fraction of saturated samples with which a capture is still used (protocol, step 1)
BLUE_BELOW, RED_ABOVE = 490e-9, 580e-9  # metres


@dataclass(frozen=True)
class Photograph:
    """One colour-sequential photograph.

    light: ``(C, Hs, Ws)`` float32, proportional to the light on the sensor, dark frame subtracted in float, divided
    by the exposure: counts per second, or counts where the exposure is not known; saturated: fraction of samples that
    no exposure of a bracket measured; exposure: seconds per channel (1 where it is not known).
    """

    light: Tensor
    saturated: float
    exposure: tuple[float, ...]


def plane_of(wavelength: float) -> int:
    """The plane (red, green, blue) of a colour camera that sees light of a wavelength [m]."""
    return 0 if wavelength > RED_ABOVE else 2 if wavelength < BLUE_BELOW else 1


@dataclass(frozen=True, eq=False)
class Request:
    """A hologram to be shown and photographed.

    phase: ``(C, H, W)`` [rad], or frames ``(F, C, H, W)`` that share the exposure for equal times; relative_exposure:
    of the bench's own exposure time, for targets whose white pixels get more or less light; role: what it is for,
    ``hologram`` or ``fiducial``; names: tell it from others with the same phase, as they name the noise of a simulated
    bench; target: name of the target that it is scored against, empty for a hologram that is not scored.
    """

    phase: Tensor
    relative_exposure: float
    role: str
    names: tuple[object, ...]
    target: str = ""


class Photographer(Protocol):
    """Shows holograms on a real panel and photographs them: live, or by an exchange of files."""

    def announce(self, requests: Sequence[Request]) -> None:
        """Say what is asked for next, none of which depends on a photograph of another.

        An exchange of files sends them out together; a live one has nothing to do.
        """

    def photograph(self, request: Request) -> Photograph:
        """Show a phase and photograph it. Pending: somebody still has to. CellError: it cannot be used."""
