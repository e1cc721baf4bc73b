"""The photographer of a session folder: writes what is asked for, reads what was photographed."""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from ...errors import CellError, Pending, UserError
from ...study.identity import digest
from ...study.images import write_png
from ...study.store import write_atomically
from ..convention import Levels
from ..photograph import Photograph, Request
from .checks import Series, check_present, check_series
from .frames import Facts, Plane, facts, find, read_frame
from .manifest import (
    DARK,
    FIDUCIAL,
    REPEAT,
    Manifest,
    Pattern,
    capture_of,
    file_of,
    inside,
    read_manifest,
    write_manifest,
)
from .order import Showing, ordered

RED, BLUE = 580e-9, 490e-9
"""Wavelengths [m] beyond which light belongs to the red and to the blue channel of a colour camera."""


class FolderPhotographer:
    """Photographs that people take with their own software.

    What is asked for and not there is noted in ``wanted``; ``write_round`` writes the patterns for it. The dark level
    is the mean of a round's dark frames, pixel by pixel. ``series`` of a round is known once its photographs were
    checked.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.manifest: Manifest = read_manifest(folder)
        self.wanted: dict[str, Request] = {}
        self.repeated: Request | None = None
        self._series: dict[int, Series] = {}
        self._dark: dict[tuple[int, int], Plane] = {}
        self._known = {(one.key, one.colour): one for one in self.manifest.patterns}

    def announce(self, requests: Sequence[Request]) -> None:
        """Note what has no pattern yet."""
        for request in requests:
            if self.repeated is None and request.role == FIDUCIAL:
                self.repeated = request
            key = self._key(request)
            if (key, 0) not in self._known:
                self.wanted.setdefault(key, request)

    def photograph(self, request: Request) -> Photograph:
        """The photograph of a request. Pending where it has not been taken; CellError where it cannot be used."""
        self.announce([request])
        key = self._key(request)
        patterns = [self._known.get((key, colour)) for colour in range(len(request.phase))]
        taken = [one for one in patterns if one is not None and one.round in self._series]
        if len(taken) < len(patterns):
            raise Pending("this hologram has not been photographed yet")
        planes = [self.light(pattern) for pattern in taken]
        exposures = tuple(pattern.exposure for pattern in taken)
        saturated = max(self._series[pattern.round].saturated[pattern.capture] for pattern in taken)
        return Photograph(torch.from_numpy(np.stack(planes)), saturated, exposures)

    def light(self, pattern: Pattern) -> Plane:
        """A photograph ``(Hs, Ws)`` with the dark level taken off, in counts per relative exposure, float32."""
        frame = self._frame(pattern)
        place = (pattern.round, pattern.colour)
        if place not in self._dark:
            dark = [
                self._frame(one)
                for one in self.manifest.of_round(pattern.round)
                if one.role == DARK and one.colour == pattern.colour
            ]
            self._dark[place] = np.mean(dark, axis=0, dtype=np.float32)
        return np.asarray((frame - self._dark[place]) / np.float32(pattern.exposure))

    def _frame(self, pattern: Pattern) -> Plane:
        path = find(self.folder, pattern.capture)
        known = (self.manifest.photographed or {}).get(pattern.capture)
        if path is None:
            raise CellError(f"{pattern.capture}: the photograph is gone")
        frame = read_frame(path, self._channel(pattern.colour))
        if known is not None and frame.sha256 != known:
            raise CellError(f"{path}: has changed since its round was read; a session is one series of photographs")
        return frame.counts

    def _channel(self, colour: int) -> int:
        """The channel of a colour camera that sees a wavelength."""
        if len(self.manifest.wavelengths) == 3:
            return colour
        wavelength = self.manifest.wavelengths[colour]
        return 0 if wavelength > RED else 2 if wavelength < BLUE else 1

    def check_round(self, number: int) -> tuple[list[str], Mapping[str, str]]:
        """Read every photograph of a round. Faults, a line each, and the sha256 of the files by capture name."""
        patterns = self.manifest.of_round(number)
        found = {pattern.capture: find(self.folder, pattern.capture) for pattern in patterns}
        faults = check_present(self.folder, patterns, found)
        if faults:
            return faults, {}
        known: dict[str, Facts] = {}
        for pattern in patterns:
            path = found[pattern.capture]
            assert path is not None
            known[pattern.capture] = facts(read_frame(path, self._channel(pattern.colour)))
        before = self.manifest.photographed or {}
        changed = [name for name, one in known.items() if before.get(name, one.sha256) != one.sha256]
        if changed:
            raise UserError(
                f"{self.folder / changed[0]}: has changed since its round was read; put the file back, or export a new "
                "session: one is one series of photographs"
            )
        series, faults = check_series(patterns, known)
        if not faults:
            self._series[number] = series
        return faults, {name: one.sha256 for name, one in known.items()}

    def accept(self, captures: Mapping[str, str]) -> None:
        """Keep what was read, so that a later change is noticed; captures: sha256 by name."""
        self.manifest = self.manifest.read_already(dict(captures))
        write_manifest(self.folder, self.manifest)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the scores should know of the photographs, a line each."""
        return tuple(dict.fromkeys(note for series in self._series.values() for note in series.notes))

    def write_round(self) -> list[Pattern]:
        """Write the patterns of everything that is wanted, and ``order.csv``; those of the new round."""
        assert self.repeated is not None
        number = self.manifest.rounds + 1
        showings = ordered(list(self.wanted.values()), self.repeated, f"{self.manifest.session} {number}")
        patterns: list[Pattern] = []
        for showing in showings:
            patterns += self._written(showing, number, len(patterns))
        self.manifest = replace(self.manifest, patterns=(*self.manifest.patterns, *patterns))
        write_manifest(self.folder, self.manifest)
        self._known |= {(one.key, one.colour): one for one in patterns}
        self.wanted.clear()
        (inside(self.folder, patterns[0].capture).parent).mkdir(parents=True, exist_ok=True)
        _write_order(self.folder / Path(patterns[0].file).parent / "order.csv", patterns, self.manifest.wavelengths)
        return patterns

    def _written(self, showing: Showing, round_: int, before: int) -> list[Pattern]:
        colours = range(len(self.manifest.wavelengths))
        request, manifest = showing.request, self.manifest
        if request is None:
            levels: Levels = np.zeros((len(colours), *manifest.panel), dtype=np.uint8)
        else:
            levels = manifest.phase.levels(request.phase)
        exposure = 1.0 if request is None or manifest.fixed_exposure else request.relative_exposure
        key = self._key(request) if request and showing.role != REPEAT else digest([showing.role, round_, showing.copy])
        patterns = []
        for colour in colours:
            number = before + colour + 1
            path = inside(self.folder, file_of(round_, number))
            write_png(path, torch.from_numpy(levels[colour][None]), bits=8)
            patterns.append(
                Pattern(
                    round=round_,
                    number=number,
                    role=showing.role,  # type: ignore[arg-type]
                    colour=colour,
                    exposure=exposure,
                    key=key,
                    sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
                    file=file_of(round_, number),
                    capture=capture_of(round_, number),
                )
            )
        return patterns

    def _key(self, request: Request) -> str:
        """What a photograph is kept by: what is shown, how long it is exposed, and what for."""
        levels = self.manifest.phase.levels(request.phase)
        shown = hashlib.sha256(levels.tobytes()).hexdigest()
        exposure = 1.0 if self.manifest.fixed_exposure else request.relative_exposure
        return digest([shown, list(levels.shape), exposure, request.role, [str(name) for name in request.names]])


def _write_order(path: Path, patterns: Sequence[Pattern], wavelengths: Sequence[float]) -> None:
    """The order of showing as a table, for people and for scripts."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["number", "show", "save_photograph_as", "role", "wavelength_nm", "relative_exposure", "laser"])
    for one in patterns:
        wavelength = f"{wavelengths[one.colour] * 1e9:.1f}"
        laser = "blocked" if one.role == DARK else "on"
        row = [one.number, one.file, f"{one.capture}.png", one.role, wavelength, f"{one.exposure:g}", laser]
        writer.writerow(row)
    write_atomically(path, text.getvalue().encode())
