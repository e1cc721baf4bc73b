"""The package from Python: open a display, solve, capture, score, compare. NumPy in, NumPy out.

A study (``holoeval run``) measures the same with repeats, intervals, tests and a record of every number, and runs the
methods of files in processes of their own; what is here is for a notebook, where all code runs together.
"""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ..core.errors import CellError, UserError, reason
from ..core.panels import is_small, rows_and_columns
from ..core.plugins import build
from ..datasets.base import fit, with_channels
from ..datasets.images import decode, from_array, read
from ..display.api import DisplaySpec, from_numpy, ideal_image, is_plain, type_name
from ..display.phases import check_phase, phase_doubt
from ..display.traits import traits_of
from ..metrics import catalogue, match
from ..metrics import score as _score
from ..optics.colour import srgb_encode
from ..study import opening
from ..study.displays import Condition, condition, real_condition
from .given import LIGHT, RADIANS, Numbers, array_of, as_in_config, capture_of, names, path_of, tensor_of, whole
from .methods import method_of

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float32]
ENDINGS = (".png", ".jpg", ".jpeg")


class OpenDisplay:
    """A display that is open and registered, as ``open_display`` gives it."""

    def __init__(self, display: Condition, seed: int, folder: Path) -> None:
        self._folder = folder
        self.spec: DisplaySpec = display.spec
        """Nominal optics in SI units: panel, pitch, wavelengths, propagation distance, scored region."""
        with self._threads():
            self._bench = opening.open_display(display, seed)

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
            light = from_array(array_of(picture, "a picture"))
        return with_channels(fit(light, self.spec.region.shape), len(self.spec.wavelengths)).numpy()

    def solve(self, method: Any, target: Numbers, **params: Any) -> Array:
        """The phase that a method finds for a target.

        Parameters
        ----------
        method
            A registered name, ``path/to/file.py:Name``, a function ``solve(target, bench)`` or a partial of one, or a
            method's class or an instance of it. It is given tensors of torch, and returns one or an array of NumPy. A
            method that has to be trained needs a study, which keeps what it learned.
        target
            ``(C, h, w)`` linear light in [0, 1], as ``target`` gives it.
        **params
            Of the method. Paths of files that it reads start in the working directory.

        Returns
        -------
        ndarray
            ``(C, H, W)`` phase [rad].

        Raises
        ------
        UserError
            An unknown method or parameter, a method that has to be trained, or another target.
        CellError
            The method failed, or gave what no display can show.
        """
        light = self._target(target)
        solver, label = self._solver(method, params)
        if traits_of(solver, label).trains:
            raise UserError(f"method '{label}' has to be trained: name it in a study, and use holoeval run")
        handle = self._bench.for_method(solver, label, light, _name(light), 0)
        try:
            with self._threads():
                phase = from_numpy(solver.solve(light[None].clone(), handle))
        except (CellError, UserError):
            raise
        except (Exception, SystemExit) as error:  # whatever a stranger's method does
            raise CellError(f"{label}: {reason(error)}") from error
        if not is_plain(phase) or tuple(phase.shape) != (1, len(light), *self.spec.shape):
            found = tuple(phase.shape) if isinstance(phase, Tensor) else type_name(phase)
            raise CellError(f"{label}: solve returned {found}, not a phase {(1, len(light), *self.spec.shape)}")
        check_phase(phase[0], self.spec, label)
        return phase[0].detach().cpu().numpy()

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
        if doubt := phase_doubt(shown, light, self.spec):
            warnings.warn(f"the phase {doubt}", stacklevel=2)
        with self._threads():
            return self._bench.photograph(shown, light, _name(light), whole(repeat, "repeat")).image.cpu().numpy()

    def ideal(self, phase: Numbers) -> Array:
        """What the nominal model, without any fault, makes of a phase ``(C, H, W)`` [rad].

        Returns
        -------
        ndarray
            ``(C, h, w)`` intensity in the scored region; the mean incident light on the panel is 1.

        Raises
        ------
        UserError
            The display shows no such phase.
        """
        return ideal_image(self._phase(phase), self.spec).numpy()

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
        return light.clamp_(0, 1)

    def _phase(self, phase: Numbers) -> Tensor:
        shown, wanted = tensor_of(phase, "a phase", RADIANS), (len(self.spec.wavelengths), *self.spec.shape)
        if tuple(shown.shape) != wanted:
            raise UserError(f"a phase of {tuple(shown.shape)}; the display shows {wanted}")
        try:
            check_phase(shown, self.spec, "")
        except CellError as error:
            raise UserError(f"a {error}") from None
        return shown

    def _solver(self, method: Any, params: dict[str, Any]) -> tuple[Any, str]:
        given = {name: as_in_config(value) for name, value in params.items()}
        if not isinstance(method, str):
            return method_of(method, given)
        return build("methods", method, given, self._folder), method.rpartition(":")[2]


def open_display(
    name: str | Path = "leto-2020", panel: tuple[int, int] | None = (256, 256), seed: int = 0, folder: str | Path = "."
) -> OpenDisplay:
    """Open a display, and register its camera.

    Parameters
    ----------
    name
        Of a display profile, or the path of one.
    panel
        Rows and columns of the panel [px], None for all of it.
    seed
        Of all random numbers.
    folder
        Where relative paths of the name and of methods start.

    Returns
    -------
    OpenDisplay
        The display, registered.

    Raises
    ------
    UserError
        There is no such display, or it has no such panel.
    CellError
        Its camera cannot be registered.

    Examples
    --------
    >>> display = open_display("ideal", panel=(128, 128))
    >>> target = display.target(np.full((60, 60, 3), 0.5))
    >>> target.shape
    (3, 104, 104)
    >>> phase = display.solve("double_phase", target)
    >>> "psnr_linear" in score(display.capture(phase, target), target=target)
    True
    """
    if not isinstance(name, str | Path):
        raise UserError(f"name: expected that of a display profile, or its path; got {type(name).__name__}")
    start = path_of(folder, "folder")
    return OpenDisplay(condition(str(name), rows_and_columns(panel), start), whole(seed, "seed"), start)


def open_bench(file: str | Path, seed: int = 0) -> OpenDisplay:
    """Open the devices of a real bench, check them, and register its camera.

    Parameters
    ----------
    file
        That describes the bench, see docs/real-bench.md. Relative paths of methods start in its folder.
    seed
        Of all random numbers.

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
    return OpenDisplay(real_condition(path.name, path.parent), whole(seed, "seed"), path.parent)


def score(
    capture: Numbers, *, target: Numbers, metrics: Sequence[str] | None = None, values: str | None = None
) -> dict[str, float]:
    """The scores of a capture by the metric protocol, by the names that the columns of a study have.

    Parameters
    ----------
    capture
        ``(C, h, w)``, aligned with the target: floating point is linear light in any unit.
    target
        ``(C, h, w)`` linear light in [0, 1] as floating point. It is given by its name: the two in the other order have
        another score.
    metrics
        Names, such as ``["psnr", "ssim"]``; None for all that can be computed here.
    values
        What the numbers of the capture are: ``"linear"``, counts of light; or ``"srgb"``, levels as pictures store
        them, which are decoded. A capture of integers is refused without it.

    Returns
    -------
    dict
        Scores by name; ``psnr_linear`` is the one that reports lead with.

    Raises
    ------
    UserError
        Other shapes or values, or an unknown metric.
    """
    computed = [metric.name for metric in catalogue() if metric.available() is None] if metrics is None else metrics
    light, wanted = capture_of(capture, "a capture", values), tensor_of(target, "a target", LIGHT)
    try:
        found = _score(light, wanted, metrics=names(computed, "metrics"))
    except ValueError as error:
        raise UserError(str(error)) from None
    lost = [name for name in metrics or () if not any(key.startswith(name) for key in found)]
    if lost:
        rows, columns = light.shape[1:]
        raise UserError(f"metrics: {', '.join(lost)} cannot be computed here of {rows} x {columns} pixels")
    return found


def compare(target: Numbers, captures: Mapping[str, Numbers], path: str | Path = "compared.jpg") -> Path:
    """Draw captures side by side with their target, each with its scores, an enlarged window and the error in it.

    Parameters
    ----------
    target
        ``(C, h, w)`` linear light in [0, 1].
    captures
        ``(C, h, w)`` linear light as floating point, by the names of their columns.
    path
        Of the picture: a PNG or a JPEG, as it ends in .png, .jpg or .jpeg.

    Returns
    -------
    Path
        The picture.

    Raises
    ------
    UserError
        No captures, other shapes or values, or a path that ends otherwise.
    """
    from ..report.charts.comparison import draw_comparison
    from ..report.charts.gallery import Column, Tile, error_limit, error_map

    place = path_of(path, "path")
    if place.suffix.lower() not in ENDINGS:
        raise UserError(f"path: '{path}' should end in {', '.join(ENDINGS)}")
    if place.is_dir():
        raise UserError(f"path: '{path}' is a folder; expected a file in it")
    if not isinstance(captures, Mapping) or not all(isinstance(name, str) for name in captures):
        raise UserError('captures: expected arrays by their names, such as {"wirtinger": image}')
    if not captures:
        raise UserError("no captures to compare")
    wanted = tensor_of(target, "a target", LIGHT)
    images = {name: tensor_of(capture, f"capture '{name}'", LIGHT) for name, capture in captures.items()}
    for name, image in images.items():
        if image.shape != wanted.shape:
            raise UserError(
                f"capture '{name}' of {tuple(image.shape)}; expected that of the target, {tuple(wanted.shape)}"
            )
    measured = {name: score(image, target=wanted, metrics=("psnr", "ssim")) for name, image in images.items()}
    truth, columns, errors = _picture(wanted), [], []
    for name, scores in measured.items():
        shown = _picture(match(images[name], wanted)[0])
        note = f"{scores['psnr_linear']:.2f} dB, SSIM {scores['ssim_linear']:.3f}"
        columns.append(Column(name, (Tile(shown, note),)))
        errors.append(error_map(shown, truth))
    place.parent.mkdir(parents=True, exist_ok=True)
    draw_comparison(
        place, "captures, each at the brightness that fits best", [("", truth)], columns, error_limit(errors)
    )
    return place


def load_records(folder: str | Path) -> pd.DataFrame:
    """The records of a report, one row for each cell.

    Parameters
    ----------
    folder
        Of the report, with a ``records.csv``.

    Returns
    -------
    DataFrame
        Columns as docs/results/data.md lists them.

    Raises
    ------
    UserError
        There is no such file, or it is damaged.
    """
    from ..report.compare.runs import read_run

    return read_run(path_of(folder, "folder")).records


def _name(target: Tensor) -> str:
    """What the noise of a target's captures depends on."""
    return hashlib.sha256(target.numpy().tobytes()).hexdigest()[:16]


def _picture(light: Tensor) -> NDArray[np.float64]:
    picture = srgb_encode(light).permute(1, 2, 0).double().numpy()
    return np.repeat(picture, 3, axis=2) if picture.shape[2] == 1 else picture
