"""``manifest.json`` of a session folder: what every pattern is, and where its photograph belongs.

The file may come from anywhere. It holds no path that is followed, but for that of a correction map, which has to lie
in the folder: names of other files follow from numbers, and are in it for other people's scripts only.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from annotated_types import Interval, Len, MaxLen, MinLen

from ...core.errors import CellError, UserError
from ...core.io import read_text, write_atomically
from ...core.schema import FieldError, checked
from ...imaging.convention import Convention
from ...methods.files.correction import on_panel

FILE, PATTERNS, CAPTURES = "manifest.json", "patterns", "captures"
FORMAT = 1
LARGEST_MANIFEST = 64 * 2**20  # bytes, about 200,000 patterns
SUFFIXES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2")
DARK, FIDUCIAL, HOLOGRAM, REPEAT = "dark", "fiducial", "hologram", "repeat"
LETTER, REVERSED = "letter", "reversed"
CHECKS = 0  # the round of the patterns that check the bench, which may be left out

Role = Literal["dark", "fiducial", "hologram", "repeat", "letter", "reversed"]
Hex = Annotated[str, Len(64, 64)]
Number = Annotated[int, Interval(ge=1, le=1_000_000)]


@dataclass(frozen=True)
class FrameFile:
    """A further gray picture of an exposure: its file (see ``file_of``) and the sha256 of that."""

    file: Annotated[str, MaxLen(100)]
    sha256: Hex


@dataclass(frozen=True)
class Pattern:
    """One gray picture for the panel, or several that share an exposure.

    round: from 1, `CHECKS` for the patterns that check the bench; number: its place in the order of its round, from 1;
    role: ``letter`` and ``reversed`` are the test pattern with the sign of the phase as stated and with the other one;
    colour: index of the wavelength it is lit with; exposure: exposure time relative to the session's own; key: tells
    what it is needed for; sha256: of the PNG file; file, capture: their names (see ``file_of`` and ``capture_of``),
    which are compared and not used; target: sha256 of the name of the target that it is scored against, empty where it
    is not scored; frames: those after the first, where several share the exposure for equal times, in this order.
    """

    round: Annotated[int, Interval(ge=0, le=1_000_000)]
    number: Number
    role: Role
    colour: Annotated[int, Interval(ge=0, le=2)]
    exposure: Annotated[float, Interval(gt=0, lt=1e6)]
    key: Hex
    sha256: Hex
    file: Annotated[str, MaxLen(100)]
    capture: Annotated[str, MaxLen(100)]
    target: Annotated[str, MaxLen(64)] = ""
    frames: Annotated[tuple[FrameFile, ...], MaxLen(255)] = ()

    @property
    def shown(self) -> tuple[FrameFile, ...]:
        """All pictures of the exposure, in the order of showing."""
        return (FrameFile(self.file, self.sha256), *self.frames)


@dataclass(frozen=True)
class Manifest:
    """A session: its study and display, and all patterns so far, round by round in the order of showing.

    session: what tells it from others; study_sha256, bench_sha256: of its config and of its bench or profile; display:
    name; panel: rows and columns; wavelengths [m]; phase: what the panel's levels mean, whose correction map lies in
    the session's folder; dark: the counts without light, or the sha256 of the file that has them; None where dark
    frames are photographed; photographed: sha256 of the photographs that were read, by the
    name of their pattern's capture.
    """

    format: Literal[1]
    session: Hex
    study_sha256: Hex
    bench_sha256: Hex
    display: Annotated[str, MinLen(1), MaxLen(200)]
    panel: tuple[Annotated[int, Interval(ge=64, le=8192)], Annotated[int, Interval(ge=64, le=8192)]]
    wavelengths: Annotated[tuple[Annotated[float, Interval(gt=0, lt=1e-4)], ...], MinLen(1), MaxLen(3)]
    phase: Convention
    fixed_exposure: bool
    patterns: Annotated[tuple[Pattern, ...], MaxLen(1_000_000)] = ()
    photographed: dict[Annotated[str, MaxLen(100)], Hex] | None = None
    dark: Annotated[float, Interval(ge=0)] | Hex | None = None

    @property
    def rounds(self) -> int:
        """Rounds so far."""
        return max((pattern.round for pattern in self.patterns), default=0)

    def of_round(self, number: int) -> list[Pattern]:
        """The patterns of a round in the order of showing."""
        return [pattern for pattern in self.patterns if pattern.round == number]


def file_of(round_: int, number: int, frame: int = 1) -> str:
    """Where the PNG of a pattern is, in the session's folder; frame: its number among those of an exposure, from 1."""
    which = "" if frame == 1 else f"-frame-{frame}"
    return f"{PATTERNS}/{_folder_of(round_)}/{number:04d}{which}.png"


def capture_of(round_: int, number: int) -> str:
    """Where the photograph of a pattern belongs, without the ending of its kind."""
    return f"{CAPTURES}/{_folder_of(round_)}/{number:04d}"


def dark_name(sha256: str) -> str:
    """The name, without its ending, of the file of dark counts in a session: no other file there has it."""
    return f"dark-{sha256[:16]}"


def _folder_of(round_: int) -> str:
    return "checks" if round_ == CHECKS else f"round-{round_}"


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write ``manifest.json``, whole or not at all."""
    content = asdict(manifest)
    del content["phase"]["turns"]
    text = json.dumps(content, indent=1, allow_nan=False)
    write_atomically(folder / FILE, f"{text}\n".encode())


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a session folder, checked. UserError says what is wrong with it."""
    path = folder / FILE
    if not path.is_file() or path.is_symlink():
        raise UserError(f"{path}: no such file; holoeval session export makes a session folder")
    content = _json(path)
    version = content.get("format") if isinstance(content, dict) else None
    if version != FORMAT:
        raise UserError(f"{path}: format {str(version)[:20]!r} should be {FORMAT}; not a manifest of this version")
    try:
        manifest = checked(Manifest, content)
    except FieldError as error:
        raise UserError(f"{path}: {error}") from None
    _check_names(path, manifest.patterns)
    if manifest.phase.correction:
        inside(folder, manifest.phase.correction.file)
    try:
        phase = on_panel(manifest.phase, manifest.panel, len(manifest.wavelengths), folder)
    except CellError as error:
        raise UserError(f"{path}: phase: {error}") from error
    return replace(manifest, phase=phase)


def _json(path: Path) -> Any:
    def refuse(name: str) -> float:
        raise ValueError(f"{name} is no number")

    try:
        return json.loads(read_text(path, LARGEST_MANIFEST), parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path}: not JSON ({str(error)[:100]})") from None


def _check_names(path: Path, patterns: Sequence[Pattern]) -> None:
    """Refuse numbers that are not 1, 2, 3, ... and names that do not follow from them."""
    last = (0, 0)
    for pattern in patterns:
        here = (pattern.round, pattern.number)
        if here not in ((last[0], last[1] + 1), (last[0] + 1, 1)):
            raise UserError(f"{path}: pattern {here[1]} of round {here[0]} stands after {last[1]} of round {last[0]}")
        files = [("file", each.file, file_of(*here, frame)) for frame, each in enumerate(pattern.shown, 1)]
        for what, name, right in (*files, ("capture", pattern.capture, capture_of(*here))):
            if name != right:
                raise UserError(f"{path}: {what} {name[:60]!r} should be {right!r}")
        last = here


def refuse_links_out(folder: Path) -> None:
    """UserError for any link in a session folder that leads out of it: nothing else is read, or written to."""
    home = folder.resolve()
    for parent, folders, files in os.walk(home):
        for name in (*folders, *files):
            inside(home, str(Path(parent, name).relative_to(home)))


def inside(folder: Path, name: str) -> Path:
    """A file of the session folder. UserError for one that is, by way of links, anywhere else."""
    path = folder / name
    if not path.resolve().is_relative_to(folder.resolve()):
        raise UserError(f"{path}: leads out of the session folder; put the file itself there")
    return path
