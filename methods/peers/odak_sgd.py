"""odak's hologram optimiser, as its documentation says to call it.

odak (K. Akşit and others, github.com/kaanaksit/odak, MPL-2.0), ``odak.learn.wave.stochastic_gradient_descent``.
"""

from __future__ import annotations

import logging
from contextlib import chdir, redirect_stderr
from dataclasses import dataclass
from functools import cache
from io import StringIO
from tempfile import TemporaryDirectory
from typing import Annotated, Any, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ..common import Bench, ByColour
from .loading import load, unavailable


@dataclass(frozen=True)
class OdakSGD(ByColour):
    """odak: Adam on the phase through odak's own propagation (needs the extra 'peers').

    odak compares the intensity of a panel lit with 1 with the image in [0, 1] as it is, without a factor between them,
    and starts from a normally distributed phase; both are kept, as is its band-limited angular spectrum on twice the
    panel's size. Handed over is a loss: the mean squared error of the region, so that light outside of it is free as it
    is for every other method. odak is not told of an iris, and gives back the phase of its last iteration. Its transfer
    function is sampled half a sample of frequency off, so that its picture lies ``wavelength * distance / (4 * side)``
    metres aside on each axis, otherwise for each colour (side: that of the panel); and the light between the pixels of
    a picture with a random start is speckle. On a GPU torch draws its start there, so that it is another one than on
    the CPU.

    Parameters
    ----------
    iterations : int
        odak's default is 100.
    learning_rate : float
        Adam's step [rad]; odak's default.
    """

    iterations: Annotated[int, Interval(ge=1, le=100_000)] = 200
    learning_rate: Annotated[float, Interval(gt=0, le=10)] = 0.1

    title: ClassVar[str] = "gradient descent of odak"
    fresnel: ClassVar[bool] = True

    def available(self) -> str | None:
        """Why the method cannot run here, in one line; None if it can."""
        return unavailable(_odak)

    def retrieve(self, target: Tensor, bench: Bench, channel: int) -> Tensor:
        """The phase of odak's last iteration; UserError where odak is not installed."""
        wave = _odak()
        return torch.stack([self._descend(wave, image, bench, channel) for image in target])

    def _descend(self, wave: Any, target: Tensor, bench: Bench, channel: int) -> Tensor:
        spec = bench.spec
        region, wanted = spec.region, spec.region.embed(target, spec.shape)

        def in_region(intensity: Tensor, image: Tensor) -> Tensor:
            return torch.nn.functional.mse_loss(region.crop(intensity), region.crop(image))

        seed = int(torch.randint(2**62, (), generator=bench.generator("odak", channel)))
        # odak draws its start from torch's global numbers, and draws a bar for each call
        with torch.random.fork_rng(), redirect_stderr(StringIO()):
            torch.manual_seed(seed)
            hologram, _ = wave.stochastic_gradient_descent(
                wanted,
                wavelength=spec.wavelengths[channel],
                distance=spec.distance,
                pixel_pitch=spec.pitch,
                propagation_type="Bandlimited Angular Spectrum",
                n_iteration=self.iterations,
                loss_function=in_region,
                learning_rate=self.learning_rate,
            )
        phase: Tensor = wave.calculate_phase(hologram.detach())
        return phase.to(target.dtype)


@cache
def _odak() -> Any:
    """``odak.learn.wave``. UserError where it is not installed.

    Its import opens a log in the working directory, and every propagation writes a line to it; neither is wanted.
    """
    with TemporaryDirectory() as folder, chdir(folder):
        wave = load("odak.learn.wave")
        log = logging.getLogger("odak")
        for handler in tuple(log.handlers):
            log.removeHandler(handler)
            handler.close()
    log.setLevel(logging.ERROR)
    return wave
