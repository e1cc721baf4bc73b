"""A display that is open: targets, phases, captures."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ..core.device import find
from ..core.errors import CellError, UserError, reason
from ..core.panels import is_small, rows_and_columns
from ..core.plugins import build
from ..datasets.base import fit, with_channels
from ..datasets.images import decode, from_array, read
from ..display.api import DisplaySpec
from ..display.nominal import ideal_image, nominal_levels
from ..display.phases import check_phase, from_numpy, is_plain, phase_doubt, single, type_name
from ..display.traits import refuse_plane, traits_of
from ..lab.drivers.catalogue import adopted
from ..study import opening
from ..study.displays import Condition, condition, real_condition
from .described import CAPTURE, IDEAL, PHASE, SEEN, TARGET, Array, Described, described
from .given import LIGHT, RADIANS, Numbers, array_of, as_in_config, path_of, tensor_of, warn_of_levels, whole
from .methods import method_of


class OpenDisplay:
    """A display that is open and registered, as ``open_display`` gives it."""

    def __init__(self, display: Condition, seed: int, folder: Path, device: torch.device) -> None:
        self._folder, self._device = folder, device
        self.spec: DisplaySpec = display.spec
        """Nominal optics in SI units: panel, pitch, wavelengths, propagation distance, scored region."""
        with self._threads():
            self._bench = opening.open_display(display, seed, device)

    def __repr__(self) -> str:
        (rows, columns), (high, wide), spec = self.spec.shape, self.spec.region.shape, self.spec
        colours = ", ".join(f"{wavelength * 1e9:.4g}" for wavelength in spec.wavelengths)
        return (
            f"<display {spec.name}: panel of {rows} x {columns} pixels of {spec.pitch * 1e6:.3g} um, {colours} nm, "
            f"{spec.distance * 1e3:.4g} mm, scores {high} x {wide} pixels>"
        )

    def target(self, picture: str | Path | Numbers) -> Array:
        """A picture as a target of this display: cropped to the aspect of the scored region and resized.

        Parameters
        ----------
        picture
            A file (8-bit RGB or gray, sRGB), or an array ``(H, W)``, ``(H, W, 3)``, ``(3, H, W)`` or ``(1, H, W)``, the
            first of them that fits: uint8 holds sRGB levels, floating point holds linear light in [0, 1].

        Returns
        -------
        ndarray
            ``(C, h, w)`` linear light in [0, 1]; C is the number of the display's wavelengths.

        Raises
        ------
        UserError
            The file or the array is no such picture.
        """
        if isinstance(picture, str | Path):
            light = decode(read(path_of(picture, "a picture")), str(picture), gray=True)
        else:
            array = array_of(picture, "a picture")
            light = from_array(array)
            warn_of_levels(array, stacklevel=2)
        return described(with_channels(fit(light, self.spec.region.shape), len(self.spec.wavelengths)).numpy(), TARGET)

    def solve(self, method: Any, target: Numbers, **params: Any) -> Array:
        """The phase that a method finds for a target.

        Parameters
        ----------
        method
            A registered name, ``path/to/file.py:Name``, a function ``solve(target, bench)`` or a partial of one, or a
            method's dataclass or an instance of it. It is given tensors of torch, and returns one or an array of NumPy.
            A method that has to be trained needs a study, which keeps what it learned.
        target
            ``(C, h, w)`` linear light in [0, 1], as ``target`` gives it.
        **params
            Of the method. Paths of files that it reads start in the working directory.

        Returns
        -------
        ndarray
            ``(C, H, W)`` phase [rad], or frames ``(F, C, H, W)``.

        Raises
        ------
        UserError
            An unknown method or parameter, a method that has to be trained, or another target.
        CellError
            The method failed, or gave what no display can show.
        """
        if isinstance(method, np.ndarray | Tensor):
            raise UserError("solve has an array in the place of its method; expected solve(method, target)")
        light = self._target(target)
        own = {name: as_in_config(value) for name, value in params.items()}
        if isinstance(method, str):
            solver, label = build("methods", method, own, self._folder), method.rpartition(":")[2]
        else:
            solver, label = method_of(method, own)
        traits = traits_of(solver, label)
        if traits.trains:
            raise UserError(f"method '{label}' has to be trained: name it in a study, and use holoeval run")
        refuse_plane(traits, label, self.spec)
        handle = self._bench.for_method(solver, label, light, _name(light), 0)
        try:
            with self._threads():
                given = solver.solve(light[None].clone(), handle)
            output = from_numpy(np.asarray(given) if isinstance(given, Described) else given)
        except (CellError, UserError):
            raise
        except (Exception, SystemExit) as error:  # whatever a stranger's method does
            raise CellError(f"{label}: {reason(error)}") from error
        phase = single(output, len(light)) if is_plain(output) else None
        if phase is None or tuple(phase.shape[-2:]) != self.spec.shape:
            found = tuple(output.shape) if isinstance(output, Tensor) else type_name(output)
            raise CellError(f"{label}: solve returned {found}, not a phase {(1, len(light), *self.spec.shape)}")
        check_phase(phase, self.spec, label)
        return described(phase.detach().cpu().numpy(), SEEN if traits.sees or traits.simulates else PHASE)

    def capture(self, phase: Numbers, target: Numbers, repeat: int = 0) -> Array:
        """Show a phase, photograph it and bring the capture into the frame of the target.

        Parameters
        ----------
        phase
            ``(C, H, W)`` [rad], any range.
        target
            ``(C, h, w)`` linear light in [0, 1]: the picture that the phase is for, which sets the exposure.
        repeat
            Another number is another photograph, with other noise.

        Returns
        -------
        ndarray
            ``(C, h, w)`` linear light; 1 is what a white pixel gets if all light of the panel went into the target.

        Raises
        ------
        UserError
            The display shows no such phase, or another target.
        CellError
            The camera cannot be registered.
        """
        light, shown = self._target(target), self._phase(phase)
        if doubt := phase_doubt(shown, light, self.spec, getattr(phase, "what", "") == SEEN):
            warnings.warn(f"the phase {doubt}", stacklevel=2)
        with self._threads():
            taken = self._bench.photograph(shown, light, _name(light), whole(repeat, "repeat"))
        return described(taken.image.cpu().numpy(), CAPTURE)

    def ideal(self, phase: Numbers) -> Array:
        """What the nominal model, without any fault, makes of a phase ``(C, H, W)`` [rad]; of a panel with a table, or
        fewer than 8 bits, of its levels.

        Returns
        -------
        ndarray
            ``(C, h, w)`` intensity in the scored region; the mean incident light on the panel is 1.

        Raises
        ------
        UserError
            The display shows no such phase.
        """
        shown = nominal_levels(self._phase(phase), self.spec)
        return described(ideal_image(shown, self.spec).cpu().numpy(), IDEAL)

    @contextmanager
    def _threads(self) -> Iterator[None]:
        """As many of torch's threads as a study has on this panel."""
        before = torch.get_num_threads()
        torch.set_num_threads(1 if is_small(self.spec.shape) else before)
        try:
            yield
        finally:
            torch.set_num_threads(before)

    def _target(self, target: Numbers) -> Tensor:
        light, wanted = tensor_of(target, "a target", LIGHT), (len(self.spec.wavelengths), *self.spec.region.shape)
        if tuple(light.shape) != wanted:
            raise UserError(f"a target of {tuple(light.shape)}; expected {wanted}, as OpenDisplay.target gives it")
        low, high = (float(value) for value in light.aminmax())
        if not (low >= -1e-6 and high <= 1 + 1e-6):  # as the metric protocol; nor NaN
            raise UserError(f"a target with values from {low:.4g} to {high:.4g}; expected linear light in [0, 1]")
        return light.clamp_(0, 1).to(self._device)

    def _phase(self, phase: Numbers) -> Tensor:
        shown, wanted = tensor_of(phase, "a phase", RADIANS), (len(self.spec.wavelengths), *self.spec.shape)
        if shown.ndim not in (3, 4) or tuple(shown.shape[-3:]) != wanted:
            raise UserError(f"a phase of {tuple(shown.shape)}; the display shows {wanted}")
        try:
            check_phase(shown, self.spec, "")
        except CellError as error:
            raise UserError(f"a {error}") from None
        return shown.to(self._device)


def open_display(
    name: str | Path = "leto-2020",
    panel: tuple[int, int] | None = (256, 256),
    seed: int = 0,
    folder: str | Path = ".",
    device: str = "cpu",
) -> OpenDisplay:
    """Open a display, and register its camera.

    Parameters
    ----------
    name
        Of a display profile, or the path of one.
    panel
        Rows and columns of the panel [px], at most all of it, as with None.
    seed
        Of all random numbers.
    folder
        Where relative paths of the name and of methods start.
    device
        Where the display and methods compute: "cpu", "cuda", "cuda:1", or "auto" for a GPU where there is one.

    Returns
    -------
    OpenDisplay
        The display, registered.

    Raises
    ------
    UserError
        There is no such display or device, or the display has no such panel.
    CellError
        Its camera cannot be registered.

    Examples
    --------
    >>> display = open_display("ideal", panel=(128, 128))
    >>> target = display.target(np.full((60, 60, 3), 0.5))
    >>> target
    <target, linear light in [0, 1]: (3, 104, 104), from 0.5 to 0.5>
    >>> phase = display.solve("double_phase", target)
    >>> display.capture(phase, target).shape
    (3, 104, 104)
    """
    if not isinstance(name, str | Path):
        raise UserError(f"name: expected that of a display profile, or its path; got {type(name).__name__}")
    start = path_of(folder, "folder")
    return OpenDisplay(condition(str(name), rows_and_columns(panel), start), whole(seed, "seed"), start, find(device))


def open_bench(
    file: str | Path, seed: int = 0, device: str = "cpu", slm: Any = None, camera: Any = None
) -> OpenDisplay:
    """Open the devices of a real bench, check them, and register its camera.

    Parameters
    ----------
    file
        That describes the bench, see docs/real-bench.md. Relative paths of methods start in its folder.
    seed
        Of all random numbers.
    device
        Where methods compute, see ``open_display``.
    slm, camera
        Open devices in the place of the file's, each with what ``Slm`` or ``Camera`` of holobench_eval/lab/devices.py
        needs, or of slmsuite. Each is called on a thread of its own, and closed when
        the program ends.

    Returns
    -------
    OpenDisplay
        The bench, registered.

    Raises
    ------
    UserError
        The file is wrong, or a device does not answer.
    CellError
        A check failed, or the camera cannot be registered.
    """
    path = path_of(file, "file")
    panel = None if slm is None else adopted("slm", slm)
    sensor = None if camera is None else adopted("camera", camera)
    bench = real_condition(path.name, path.parent, panel, sensor)
    return OpenDisplay(bench, whole(seed, "seed"), path.parent, find(device))


def _name(target: Tensor) -> str:
    """What the noise of a target's captures depends on."""
    return hashlib.sha256(target.cpu().numpy().tobytes()).hexdigest()[:16]
