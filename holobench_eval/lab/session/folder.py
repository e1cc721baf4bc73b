"""The photographer of a session folder: writes what is asked for, reads what was photographed."""

from __future__ import annotations

import csv
import hashlib
import io
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from ...core.errors import CellError, Pending, UserError
from ...core.hashing import digest
from ...core.io import write_atomically, write_png
from ...imaging.convention import Levels
from ..dark import Dark, given_dark
from ..photograph import Photograph, Request, plane_of
from ..preflight import EXPOSURES
from .checks import Series, check_present, check_series
from .frames import Facts, Frame, Plane, facts, find, read_frame
from .manifest import (
    CAPTURES,
    CHECKS,
    DARK,
    FIDUCIAL,
    HOLOGRAM,
    LETTER,
    PATTERNS,
    REPEAT,
    REVERSED,
    FrameFile,
    Manifest,
    Pattern,
    capture_of,
    dark_name,
    file_of,
    inside,
    read_manifest,
    write_manifest,
)

BETWEEN_REPEATS = 24  # holograms between two showings of the repeated pattern


class FolderPhotographer:
    """Photographs that people take with their own software.

    What is asked for and not there is noted in ``wanted``; ``write_round`` writes the patterns for it. The dark level
    comes from a round's dark frames, pixel by pixel, or is given. ``series`` of a round is known once its photographs
    were checked.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.manifest: Manifest = read_manifest(folder)
        self.wanted: dict[str, Request] = {}
        self.repeated: Request | None = None
        self._series: dict[int, Series] = {}
        self._contents: dict[str, str] = {}
        self._dark: dict[tuple[int, int], Dark] = {}
        self._known = {(pattern.key, pattern.colour): pattern for pattern in self.manifest.patterns}

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
        patterns = [self._known.get((key, colour)) for colour in range(request.phase.shape[-3])]
        taken = [pattern for pattern in patterns if pattern is not None and pattern.round in self._series]
        if len(taken) < len(patterns):
            raise Pending("this hologram has not been photographed yet")
        planes = [self.light(pattern) for pattern in taken]
        exposures = tuple(pattern.exposure for pattern in taken)
        saturated = max(self._series[pattern.round].saturated[pattern.capture] for pattern in taken)
        return Photograph(torch.from_numpy(np.stack(planes)), saturated, exposures)

    def light(self, pattern: Pattern) -> Plane:
        """A photograph ``(Hs, Ws)`` with the dark level taken off, in counts per relative exposure, float32."""
        dark = self.dark_of(pattern.round, pattern.colour)
        return np.asarray(dark.off(self.counts(pattern), pattern.exposure) / np.float32(pattern.exposure))

    def dark_of(self, round_: int, colour: int) -> Dark:
        """Counts without light, as given or, by the relative exposure, from a round's dark frames."""
        if self.manifest.dark is not None:
            return self._given.plane(plane_of(self.manifest.wavelengths[colour]))
        if (round_, colour) not in self._dark:
            frames: dict[float, list[Plane]] = {}
            for pattern in self.manifest.of_round(round_):
                if pattern.role == DARK and pattern.colour == colour:
                    frames.setdefault(pattern.exposure, []).append(self.counts(pattern))
            short, long = min(frames), max(frames)
            low, high = (np.asarray(np.mean(frames[exposure], axis=0), dtype=np.float32) for exposure in (short, long))
            rate = np.asarray((high - low) / np.float32(max(long - short, 1e-9)), dtype=np.float32)
            self._dark[round_, colour] = Dark(np.asarray(low - rate * np.float32(short), dtype=np.float32), rate)
        return self._dark[round_, colour]

    @cached_property
    def _given(self) -> Dark:
        """The dark counts that were given with the export. UserError where their file has changed."""
        given = self.manifest.dark
        if isinstance(given, str):
            name = dark_name(given)
            path = next(self.folder.glob(f"{name}.*"), self.folder / name)
            dark, sha256 = given_dark(str(inside(self.folder, path.name)))
            if sha256 != given:
                raise UserError(f"{path}: has changed since the session was exported; put the file back")
            return dark
        return given_dark(given or 0.0)[0]

    def counts(self, pattern: Pattern) -> Plane:
        """A photograph ``(Hs, Ws)`` as the camera counted it. CellError for one that is gone or has changed."""
        path = find(self.folder, pattern.capture)
        if path is None:
            raise CellError(f"{pattern.capture}: the photograph is gone")
        frame = self._read(path, pattern)
        if (self.manifest.photographed or {}).get(pattern.capture, frame.sha256) != frame.sha256:
            raise CellError(f"{path}: has changed since its round was read; a session is one series of photographs")
        return frame.counts

    def _read(self, path: Path, pattern: Pattern) -> Frame:
        return read_frame(path, plane_of(self.manifest.wavelengths[pattern.colour]))

    def check_round(self, number: int) -> tuple[list[str], Mapping[str, str]]:
        """Read every photograph of a round, after those before it. Faults, a line each, and the sha256 of the files by
        capture name."""
        patterns = self.manifest.of_round(number)
        files = {pattern.capture: find(self.folder, pattern.capture) for pattern in patterns}
        faults = check_present(self.folder, patterns, files)
        if faults:
            return faults, {}
        known = {
            pattern.capture: facts(self._read(path, pattern))
            for pattern in patterns
            if (path := files[pattern.capture]) is not None
        }
        sums, before = {name: frame.sha256 for name, frame in known.items()}, self.manifest.photographed or {}
        changed = [name for name, sum_ in sums.items() if before.get(name, sum_) != sum_]
        if changed:
            raise UserError(
                f"{self.folder / changed[0]}: has changed since its round was read; put the file back, or export a new "
                "session: one is one series of photographs"
            )
        series, faults = check_series(patterns, known)
        faults += self._dark_faults(next(iter(known.items())))
        faults += [
            f"duplicated: {name} is {self._contents[frame.content]} of an earlier round"
            for name, frame in known.items()
            if self._contents.get(frame.content, name) != name
        ]
        if not faults:
            self._series[number] = series
            self._contents |= {frame.content: name for name, frame in known.items() if frame.highest}
        return faults, sums

    def _dark_faults(self, photograph: tuple[str, Facts]) -> list[str]:
        """Why given dark counts are not on the scale of a round's photographs, from one that stands for all."""
        if self.manifest.dark is None:
            return []
        name, frame = photograph
        if not frame.linear:
            return [f"{name}: compressed with loss, no counts to take dark ones off; save PNG, TIFF or RAW files"]
        try:
            self._given.refuse_other_scale(frame.top)
        except UserError as error:
            return [f"{name}: {error}"]
        return []

    def accept(self, captures: Mapping[str, str]) -> None:
        """Keep what was read, so that a later change is noticed; captures: sha256 by name."""
        self.manifest = replace(self.manifest, photographed={**(self.manifest.photographed or {}), **captures})
        write_manifest(self.folder, self.manifest)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the scores should know of the photographs, a line each."""
        scored = (series for number, series in self._series.items() if number != CHECKS)
        return tuple(dict.fromkeys(note for series in scored for note in series.notes))

    def write_round(self) -> list[Pattern]:
        """Write the patterns of everything that is wanted, and ``order.csv``; those of the new round."""
        assert self.repeated is not None
        number = self.manifest.rounds + 1
        wanted = list(self.wanted.values())
        exposures = [1.0, *(self._exposure(request) for request in wanted)]
        dark = self.manifest.dark is None
        showings = ordered(wanted, self.repeated, f"{self.manifest.session} {number}", exposures, dark)
        patterns: list[Pattern] = []
        for showing in showings:
            request, place = showing.request, (number, len(patterns))
            exposure = showing.exposure if request is None else self._exposure(request)
            counted = digest([showing.role, number, showing.copy, showing.exposure])
            key = self._key(request) if request and showing.role != REPEAT else counted
            target = digest(request.target) if request and request.target else ""
            levels = None if request is None else self.manifest.phase.levels(request.phase)
            patterns += self._shown(showing.role, levels, exposure, key, target, place)
        self._finish(patterns, _readme(number, len(patterns)))
        self._known |= {(pattern.key, pattern.colour): pattern for pattern in patterns}
        self.wanted.clear()
        return patterns

    def _shown(
        self, role: str, levels: Levels | None, exposure: float, key: str, target: str, place: tuple[int, int]
    ) -> list[Pattern]:
        """Write levels ``(C, H, W)``, or of frames ``(F, C, H, W)``, or all zero, and describe them; place: round, and
        patterns before in it."""
        round_, before = place
        patterns = []
        if levels is None:
            levels = np.zeros((len(self.manifest.wavelengths), *self.manifest.panel), dtype=np.uint8)
        frames = levels[None] if levels.ndim == 3 else levels
        for colour, planes in enumerate(frames.swapaxes(0, 1)):
            number = before + colour + 1
            first, *others = [
                self._write(plane, file_of(round_, number, frame)) for frame, plane in enumerate(planes, 1)
            ]
            patterns.append(
                Pattern(
                    round=round_,
                    number=number,
                    role=role,  # type: ignore[arg-type]
                    colour=colour,
                    exposure=exposure,
                    key=key,
                    sha256=first.sha256,
                    file=first.file,
                    capture=capture_of(round_, number),
                    target=target,
                    frames=tuple(others),
                )
            )
        return patterns

    def _write(self, plane: Levels, name: str) -> FrameFile:
        path = inside(self.folder, name)
        write_png(path, torch.from_numpy(plane[None]), bits=8)
        return FrameFile(name, hashlib.sha256(path.read_bytes()).hexdigest())

    def write_checks(self, letter: Tensor) -> None:
        """Write the patterns that check the bench; letter: phase ``(C, H, W)`` [rad] of `preflight.phase_sign`."""
        phase, patterns = self.manifest.phase, list[Pattern]()
        as_set, other = phase.levels(letter), replace(phase, sign=-phase.sign).levels(letter)
        for index, (role, exposure) in enumerate(check_showings(self.manifest.fixed_exposure)):
            if role == DARK and self.manifest.dark is not None:
                continue
            levels = {LETTER: as_set, REVERSED: other}.get(role)
            key = digest([role, index])
            patterns += self._shown(role, levels, exposure, key, "", (CHECKS, len(patterns)))
        self._finish(patterns, _checks_readme(len(patterns)))

    def _finish(self, patterns: Sequence[Pattern], readme: str) -> None:
        """What a person or a script needs beside the patterns of a round, and the round in the manifest."""
        folder = self.folder / Path(patterns[0].file).parent
        _write_order(folder / "order.csv", patterns, self.manifest.wavelengths)
        write_atomically(folder / "README.txt", readme.encode())
        (inside(self.folder, patterns[0].capture).parent).mkdir(parents=True, exist_ok=True)
        # last, so that a round that the manifest has is whole
        self.manifest = replace(self.manifest, patterns=(*self.manifest.patterns, *patterns))
        write_manifest(self.folder, self.manifest)

    def _exposure(self, request: Request) -> float:
        return 1.0 if self.manifest.fixed_exposure else request.relative_exposure

    def _key(self, request: Request) -> str:
        """What a photograph is kept by: what is shown, how long it is exposed, and what for.

        The fiducial grid's holograms by their number alone: made again on another machine they may differ in a level.
        """
        names = [str(name) for name in request.names]
        if request.role == FIDUCIAL:
            return digest([request.role, names])
        levels = self.manifest.phase.levels(request.phase)
        content = hashlib.sha256(levels.tobytes()).hexdigest()
        return digest([content, list(levels.shape), self._exposure(request), request.role, names])


@lru_cache(maxsize=1)
def session_photographer(folder: Path) -> FolderPhotographer:
    """The photographer of a session folder, one for a process: what it notes is written at the end of a run."""
    return FolderPhotographer(folder)


def _write_order(path: Path, patterns: Sequence[Pattern], wavelengths: Sequence[float]) -> None:
    """The order of showing as a table, for people and for scripts."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["number", "show", "save_photograph_as", "role", "wavelength_nm", "relative_exposure", "laser"])
    for pattern in patterns:
        wavelength, exposure = f"{wavelengths[pattern.colour] * 1e9:.1f}", f"{pattern.exposure:g}"
        laser = "blocked" if pattern.role == DARK else "on"
        picture, photograph = " ".join(each.file for each in pattern.shown), f"{pattern.capture}.png"
        writer.writerow([pattern.number, picture, photograph, pattern.role, wavelength, exposure, laser])
    write_atomically(path, text.getvalue().encode())


def _readme(number: int, patterns: int) -> str:
    """What to do with a round, in words."""
    return f"""Round {number}: {patterns} patterns.

1. Show the pictures of {PATTERNS}/round-{number} in the order of order.csv, gray level for gray level, one panel pixel
   a picture pixel. Light each with the laser of its wavelength; block the laser for role 'dark'. Where 'show' names
   several, with spaces between, show them in turn for equal times within one exposure: they have one photograph.
2. Photograph each after the panel has settled, with gamma, gain control, white balance and denoising off, and the
   session's own exposure time times relative_exposure. Choose that time once, so that no hologram saturates.
3. Save each under the name in 'save_photograph_as' ({CAPTURES}/round-{number}/NNNN.png; 8- or 16-bit PNG or TIFF, or
   the camera's RAW; the same kind for all).
4. holoeval session import with the folder of manifest.json
"""


def _checks_readme(patterns: int) -> str:
    """What to do with the patterns that check the bench, in words."""
    return f"""Checks of the bench: {patterns} patterns. Photograph them before anything else, or leave them out.

1. Show them as README.txt of {PATTERNS}/round-1 says. Choose an exposure time for these patterns alone, with which the
   first with the laser on is bright and does not saturate, and multiply it by relative_exposure.
2. Save each under the name in 'save_photograph_as'.
3. holoeval session import says whether camera and panel are as they should be, a line each.
"""


@dataclass(frozen=True)
class Showing:
    """A request at its place in a round. request: None for a dark frame; exposure: of that, relative."""

    role: str
    request: Request | None
    copy: int = 0
    exposure: float = 1.0


def ordered(
    requests: Sequence[Request], repeated: Request, seed: str, exposures: Sequence[float], dark: bool
) -> Iterator[Showing]:
    """The showings of a round.

    Dark frames, where ``dark``, first and last, at the shortest and at the longest of the round's relative
    ``exposures``, since stray light and dark current grow with the time and an offset does not; then the fiducial
    holograms; then everything else in a random order that ``seed`` names, since a slow drift must not favour the
    methods that are shown first; and one hologram of the fiducial grid, ``repeated``, at the beginning, every so often,
    and at the end.
    """
    copies, spread = iter(range(1_000_000)), sorted({min(exposures), max(exposures)}) if dark else []
    yield from (Showing(DARK, None, 0, exposure) for exposure in spread)
    yield Showing(REPEAT, repeated, next(copies))
    yield from (Showing(FIDUCIAL, request) for request in requests if request.role == FIDUCIAL)
    mixed = [request for request in requests if request.role == HOLOGRAM]
    random.Random(seed).shuffle(mixed)
    for index, request in enumerate(mixed):
        if index and index % BETWEEN_REPEATS == 0:
            yield Showing(REPEAT, repeated, next(copies))
        yield Showing(HOLOGRAM, request)
    yield Showing(REPEAT, repeated, next(copies))
    yield from (Showing(DARK, None, 1, exposure) for exposure in spread)


def check_showings(fixed_exposure: bool) -> list[tuple[str, float]]:
    """Role and relative exposure of what checks the bench, in the order of showing.

    Dark frames at the ends of the exposures; the letter at the longest, which chooses the samples that linearity is
    measured on; the letter at all; the letter with the other sign. A camera with one exposure cannot show linearity.
    """
    if fixed_exposure:
        return [(DARK, 1.0), (LETTER, 1.0), (REVERSED, 1.0)]
    ends = [(DARK, exposure) for exposure in (min(EXPOSURES), max(EXPOSURES))]
    return [*ends, (LETTER, 1.0), *((LETTER, exposure) for exposure in EXPOSURES), (REVERSED, 1.0)]
