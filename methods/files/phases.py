"""Holograms that other software has made, shown as they are: the door for MATLAB, C++ or another harness."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import torch
from annotated_types import Interval, MinLen
from numpy.typing import NDArray
from torch import Tensor

from ...core.errors import CellError, UserError
from ...core.io import file_name
from ...core.plugins import LATER
from ...display.api import DisplaySpec
from ...display.metered import MeteredDisplay
from ...imaging.convention import Convention, Correction, FullTurn
from ...optics.phase import are_levels
from ..double_phase import encode
from .arrays import SUFFIXES, read_array
from .correction import on_panel, refuse_colours

COLOURS = ("red", "green", "blue")


@dataclass(frozen=True)
class Phases:
    """Phases from files, one file a target, made by any software.

    The convention of phases is that of all methods here: ``exp(+i phase)`` with light travelling as ``exp(+i k z)``;
    row 0 is the top of the picture and column 0 its left, seen from where the camera stands. A blaze is added by the
    display itself. What a file holds becomes ``sign * value + origin`` in radians. Nothing is resampled.

    An array is ``(H, W)``, ``(H, W, 3)`` or ``(3, H, W)``, or several of these, which are frames of one exposure.
    Integers, and pictures, are levels; other real numbers are
    radians; complex numbers are the field at the panel, which ``encoder`` turns into a phase.

    Parameters
    ----------
    file : str
        Path from the working directory: .png, .tif, .bmp, .npy, .npz or .mat. ``{target}`` in it stands for the name of
        the target, ``{stem}`` for that name up to its last dot (``cat`` for ``cat.jpg``), ``{channel}`` for the colour
        and ``{frame}`` for the number of the frame, where each has a file of its own. Anything but letters, digits,
        ``.``, ``-`` and ``_`` in a name becomes ``_``, and ``{target}`` then has a part of the name's hash behind;
        ``{stem}`` has it only for a name without a dot. Two targets with the same file are refused.
    amplitude : str
        Path of the amplitudes in the same manner, where amplitude and phase of a field lie in two files; empty for
        none.
    channels : tuple of str
        What ``{channel}`` stands for, one for each wavelength of the display, red first.
    variable : str
        Name of the array in a .npz or .mat file; empty where there is only one.
    levels : {"integers", "all"}
        Which real numbers are levels: integers, or all (MATLAB keeps levels as double). Floating point that is whole
        throughout and goes beyond 20 is no file of radians, and is refused unless all are levels.
    two_pi_level : float or list of float, optional
        The level whose phase is a full turn, 2 pi, one for all colours or one for each; by default 256 or 65536, by the
        bits of the file. A file of radians is refused with it.
    correction : mapping, optional
        The correction map of a panel that is in the levels, and is taken off them modulo a turn: ``file``, a picture of
        the panel's rows and columns, and ``two_pi_level``, the level of the map that is a full turn (256 unless given),
        one for all colours or one for each. It lies as the file does, before ``flip_horizontal`` and
        ``flip_vertical``; its colours are red first. A file of radians is refused with it.
    sign : {1, -1}
        -1 for phases of the opposite convention.
    origin : float
        Phase of level 0 [rad].
    flip_horizontal, flip_vertical : bool
        The file is mirrored.
    order : {"rgb", "bgr"}
        Order of the colours in an array.
    frames : int
        Frames of a hologram, which share one exposure, where ``{frame}`` names their files: 1 and up.
    encoder : {"double_phase", "phase_only"}
        How a complex field becomes a phase: by double-phase encoding, or by its phase alone.
    """

    file: Annotated[str, MinLen(1)] = "phases/{target}.npy"
    amplitude: str = ""
    channels: tuple[str, ...] = COLOURS
    variable: str = ""
    levels: Literal["integers", "all"] = "integers"
    two_pi_level: FullTurn | None = None
    correction: Correction | None = field(default=None, metadata=LATER)
    sign: Literal[1, -1] = 1
    origin: float = 0.0
    flip_horizontal: bool = False
    flip_vertical: bool = False
    order: Literal["rgb", "bgr"] = "rgb"
    encoder: Literal["double_phase", "phase_only"] = "double_phase"
    frames: Annotated[int, Interval(ge=1, le=256)] = field(default=1, metadata=LATER)

    title: ClassVar[str] = "phases from files"
    version: ClassVar[int] = 2
    timed: ClassVar[bool] = False  # reading is no solving

    def __post_init__(self) -> None:
        for name, pattern in (("file", self.file), ("amplitude", self.amplitude)):
            unknown = set(re.findall(r"\{[^}]*\}?", pattern)) - {"{target}", "{stem}", "{channel}", "{frame}"}
            if unknown:
                raise UserError(
                    f"{name}: '{min(unknown)}' stands for nothing; {{target}}, {{stem}}, {{channel}} and {{frame}} do"
                )
            if self.frames > 1 and pattern and "{frame}" not in pattern:
                raise UserError(f"frames: '{pattern}' is one file for all; name them by {{frame}}")
            if pattern and Path(pattern).suffix.lower() not in SUFFIXES:
                raise UserError(f"{name}: '{pattern}' should end in {', '.join(SUFFIXES)}")
        if self.amplitude and ("{channel}" in self.amplitude) != ("{channel}" in self.file):
            raise UserError("amplitude: {channel} should be in both patterns or in none")

    def files(self, target_name: str) -> list[str]:
        """The files that hold the phase of a target; those of all colours where each has its own."""
        patterns = [pattern for pattern in (self.file, self.amplitude) if pattern]
        numbers = range(1, self.frames + 1)
        paths = [path for each in patterns for number in numbers for path in self._paths(each, target_name, number)]
        return paths if self.correction is None else [*paths, self.correction.file]

    def refuse_display(self, spec: DisplaySpec) -> None:
        """UserError for full turns of another number of colours than the display has."""
        try:
            refuse_colours(self._convention(), len(spec.wavelengths))
        except CellError as error:
            raise UserError(str(error)) from None

    def refuse_shared(self, target_names: Iterable[str]) -> None:
        """UserError where a pattern with ``{target}`` or ``{stem}`` gives several targets the same file."""
        names, owners = list(target_names), dict[str, str]()
        for pattern in (self.file, self.amplitude):
            if not _names_targets(pattern):
                continue  # one file for all
            paths = [(path, name) for name in names for path in self._paths(pattern, name)]
            for path, owner in paths:
                if (other := owners.setdefault(path, owner)) != owner:
                    raise UserError(
                        f"'{pattern}' is the same file, {path}, for the targets '{other}' and '{owner}'; "
                        "{target} in the place of {stem} tells them apart"
                    )

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """The phase that the target's file holds.

        Parameters
        ----------
        target : Tensor
            Linear intensity ``(B, C, h, w)`` in [0, 1]; only its number of images and colours is used.
        bench : MeteredDisplay
            Nominal optics in SI units, and the name of the target.

        Returns
        -------
        Tensor
            Phase ``(B, C, H, W)`` or frames ``(B, F, C, H, W)`` [rad], the same for every image of a batch.
        """
        frames = [
            self._hologram(bench.target_name, bench.spec, target.shape[1], number + 1) for number in range(self.frames)
        ]
        phase = frames[0] if len(frames) == 1 else torch.stack(frames)
        return phase.float().to(target.device).expand(len(target), *phase.shape).clone()

    def _hologram(self, target_name: str, spec: DisplaySpec, colours: int, frame: int) -> Tensor:
        """The phase [rad] in the file of a frame, or in the only one."""
        phase = self._read(self.file, target_name, spec, colours, frame)
        if self.amplitude:
            if phase.is_complex():
                raise CellError(f"{self.file}: a complex field needs no file of amplitudes")
            modulus = self._read(self.amplitude, target_name, spec, colours, frame, phases=False)
            phase = torch.polar(modulus, phase.double())
        if phase.is_complex():
            phase = encode(phase) if self.encoder == "double_phase" else phase.angle()
        return phase

    def _paths(self, pattern: str, target_name: str, frame: int = 1) -> list[str]:
        name = file_name(target_name)
        path = pattern.replace("{target}", name).replace("{stem}", Path(name).stem).replace("{frame}", str(frame))
        return [path.replace("{channel}", name) for name in self.channels] if "{channel}" in path else [path]

    def _convention(self) -> Convention:
        return Convention(self.sign, self.origin, self.two_pi_level or 256.0, self.correction)

    def _read(
        self, pattern: str, target_name: str, spec: DisplaySpec, colours: int, frame: int, phases: bool = True
    ) -> Tensor:
        """What the files of a pattern hold, ``(C, H, W)`` or ``(F, C, H, W)``: phases [rad], complex fields, or
        amplitudes."""
        paths = self._paths(pattern, target_name, frame)
        if len(paths) > 1 and len(paths) != colours:
            raise CellError(f"channels: {len(paths)} names for the {colours} colours of '{spec.name}'")
        if (missing := next((path for path in paths if not Path(path).is_file()), None)) is not None:
            raise CellError(f"{missing}: no such file{self._altered(pattern, target_name)}{self._hint(missing)}")
        panel = on_panel(self._convention(), spec.shape, colours, Path()) if phases else None
        if len(paths) > 1:
            planes = [self._planes(path, spec, 1, panel and panel.of(index)) for index, path in enumerate(paths)]
            return torch.cat(planes)
        return self._planes(paths[0], spec, colours, panel)

    def _planes(self, path: str, spec: DisplaySpec, colours: int, panel: Convention | None) -> Tensor:
        """What a file holds, see ``_read``; panel: the meaning of its levels, None for amplitudes."""
        array = read_array(Path(path), self.variable)
        if array.ndim == 4:
            return torch.stack([self._frame(frame, path, spec, colours, panel) for frame in array])
        return self._frame(array, path, spec, colours, panel)

    def _frame(
        self, array: NDArray[Any], path: str, spec: DisplaySpec, colours: int, panel: Convention | None
    ) -> Tensor:
        if array.ndim == 3 and array.shape[-1] == colours and array.shape[:2] == spec.shape:
            array = np.moveaxis(array, -1, 0)
        if array.ndim == 2:
            array = array[None]
        if array.shape != (colours, *spec.shape):
            described = " x ".join(map(str, array.shape)) + f" values of type {array.dtype}"
            wanted = " x ".join(map(str, spec.shape)) + (f" in {colours} colours" if colours > 1 else ", one colour")
            raise CellError(
                f"{path}: {described}; '{spec.name}' shows {wanted} here, and phases are not resampled (the panel is "
                "set by display.panel)"
            )
        if self.order == "bgr":
            array = array[::-1]
        values = self._radians(array, path, panel) if panel else _real(array, path)
        if self.flip_horizontal:
            values = values[..., ::-1]
        if self.flip_vertical:
            values = values[..., ::-1, :]
        if not np.isfinite(values).all():
            raise CellError(f"{path}: holds values that are NaN or infinite")
        return torch.from_numpy(np.ascontiguousarray(values))

    @staticmethod
    def _altered(pattern: str, target_name: str) -> str:
        """Which target a file is for, where the name of the file does not say so."""
        is_altered = _names_targets(pattern) and file_name(target_name) != target_name
        return f" for the target '{target_name}'" if is_altered else ""

    def _hint(self, path: str) -> str:
        """The remedy where a pattern repeats the ending of a target's name, as in ``cat.png.png``."""
        short = Path(path).with_suffix("").with_suffix(Path(path).suffix)
        return f"; {{stem}} in the place of {{target}} names {short}" if short.is_file() else ""

    def _radians(self, array: NDArray[Any], path: str, panel: Convention) -> NDArray[Any]:
        if array.dtype.kind not in "fc" or (array.dtype.kind == "f" and self.levels == "all"):
            bits = 8 * array.dtype.itemsize
            if self.two_pi_level is None and (array.dtype.kind != "u" or bits > 16):
                raise CellError(f"{path}: levels of type {array.dtype}; say which level is a full turn: two_pi_level")
            panel = panel if self.two_pi_level else replace(panel, two_pi_level=2.0**bits)
            return panel.phase(array).numpy()
        for key in ("two_pi_level", "correction"):
            if getattr(self, key) is not None:
                held = "radians; levels need 'levels: all'" if array.dtype.kind == "f" else "a field, not levels"
                raise CellError(f"{path}: {key} is set, but {array.dtype} holds {held}")
        if array.dtype.kind == "c":
            field = array if self.sign == 1 else array.conj()
            return field * np.exp(1j * self.origin)
        if are_levels(torch.from_numpy(array.astype(np.float64))):
            raise CellError(
                f"{path}: {array.dtype}, but whole numbers up to {np.abs(array).max():g}, so levels, not radians; set "
                "'levels: all' and two_pi_level (radians that are whole: store them modulo 2 pi)"
            )
        if self.sign == 1 and not self.origin:
            return array  # to the last bit
        return self.sign * array.astype(np.float64) + self.origin


def _names_targets(pattern: str) -> bool:
    return "{target}" in pattern or "{stem}" in pattern


def _real(array: NDArray[Any], path: str) -> NDArray[Any]:
    if array.dtype.kind == "c" or bool((array < 0).any()):
        raise CellError(f"{path}: amplitudes are real and not negative")
    return array.astype(np.float64)
