"""A study on a bench that other software drives: ``holoeval session export`` and ``import``, round by round."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from ...core.errors import Pending, UserError, suggest
from ...core.hashing import digest
from ...core.io import write_atomically
from ...core.yaml_source import load
from ...imaging.convention import Convention
from ...lab.bench_file import BenchFile, device_files, load_bench_file
from ...lab.dark import given_dark
from ...lab.live import letter
from ...lab.real import RealBench
from ...lab.session import Manifest, Pattern, read_manifest, session_photographer, write_manifest
from ...lab.session.bench_checks import bench_checks
from ...lab.session.geometry import look
from ...lab.session.manifest import dark_name, refuse_links_out
from .. import isolation
from ..config import load_study
from ..definition import STACKS, Study
from ..displays import condition, displays
from ..executors import Serial
from ..opening import forget_sessions, open_display
from ..plan import plan
from ..running.progress import Lines
from ..running.run import Outcome, run
from .files import named

STUDY, BENCH, REPORT, ARTIFACTS = "study.yaml", "bench.yaml", "report", "artifacts"

OWN = ("photographs", "dead_leaves", "charts")  # datasets that come with the package and read no folder


@dataclass(frozen=True)
class Advance:
    """The result of an import or export.

    study: on the session's display, with notes on the photographs in its ``note``; patterns: of the new round that has
    to be photographed, none when the study is complete; outcome: of the cells.
    """

    study: Study
    patterns: tuple[Pattern, ...]
    outcome: Outcome


def export(
    config: Path,
    folder: Path,
    watch: Lines,
    bench: Path | None,
    display: str | None,
    fixed_exposure: bool,
    dark: str | float | None = None,
) -> Advance:
    """Make a session folder for a study and write its first round of patterns.

    bench: file of the real bench; without it ``display``, one of the study's profiles, gives the nominal optics
    (optional if the study has a single profile), and the panel's levels have the default convention. dark: the counts
    without light, a level or a file, in the place of dark frames; by default those of the bench file.
    UserError: the folder is not empty, or the study cannot be shown on one real display.
    """
    if folder.exists() and any(folder.iterdir()):
        raise UserError(f"{folder}: not empty; give a new folder, or go on there with holoeval session import {folder}")
    study = load_study(config)
    chosen = _on_one_display(study, bench, display)
    if fixed_exposure and "matched" in {entry.exposure for entry in chosen.methods}:
        raise UserError(f"{config}: exposure: matched sets exposures one by one; not with --fixed-exposure")
    shown = next(iter(displays(chosen).values()))
    if shown.spec.bits != 8:
        raise UserError(f"'{shown.name}' has {shown.spec.bits} bits; patterns are written with 8")
    file = shown.real.bench if shown.real else None
    described_bench = load_bench_file(file) if file else None
    if dark is None and described_bench:
        dark = described_bench.capture.dark
    if dark is not None:
        given_dark(dark)  # what is wrong with it is said before the folder is made
    inside = BENCH if bench else study.display.bench
    copies = _beside(described_bench, file, inside) if described_bench and file else {}
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / STUDY, chosen.text.encode())
    if inside and _stays_inside(inside):
        if (folder / inside).exists():
            raise UserError(f"{inside}: a session has a file of this name of its own; rename the bench file")
        copies = {Path(inside): bench or study.folder / inside, **copies}
    for place, original in copies.items():
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(original, folder / place)
    phase = described_bench.phase if described_bench else Convention()
    if phase.correction is not None:
        map_file = (Path(inside or BENCH).parent / phase.correction.file).as_posix()
        phase = replace(phase, correction=replace(phase.correction, file=map_file))
    text = digest(chosen.text)
    manifest = Manifest(
        format=1,
        session=digest([text, shown.digest, str(config), digest(folder.resolve().as_posix())]),
        study_sha256=text,
        bench_sha256=shown.digest,
        display=shown.name,
        panel=shown.spec.shape,
        wavelengths=shown.spec.wavelengths,
        phase=phase,
        fixed_exposure=fixed_exposure,
        dark=_kept_dark(dark, folder),
    )
    write_manifest(folder, manifest)
    forget_sessions()
    opened = replace(chosen, display=replace(chosen.display, session=folder))
    session_photographer(folder).write_checks(letter(_bench(opened)).phase)
    return _advance(opened, folder, watch)


def _beside(bench: BenchFile, file: Path, copied: str | None) -> dict[Path, Path]:
    """The files that a bench file names, by their places in a session, where the bench file's copy finds them.

    copied: place of that copy. UserError for a file that does not lie in the bench file's folder.
    """
    named = {} if bench.phase.correction is None else {"phase.correction.file": Path(bench.phase.correction.file)}
    if copied and _stays_inside(copied):  # else they are read where they are
        others = device_files(bench, file.parent)
        others |= {"capture.dark": Path(bench.capture.dark)} if isinstance(bench.capture.dark, str) else {}
        named |= {key: Path(os.path.relpath(other.resolve(), file.resolve().parent)) for key, other in others.items()}
    for key, name in named.items():
        if not (copied and _stays_inside(copied) and _stays_inside(str(name))):
            raise UserError(f"{file}: {key}: {name} does not travel with a session; put it beside this file")
    return {Path(copied or "").parent / name: file.parent / name for name in named.values()}


def _kept_dark(given: str | float | None, folder: Path) -> str | float | None:
    """The dark level for the manifest, or the sha256 of its file, of which the session gets a copy."""
    if given is None:
        return None
    dark, name = given_dark(given)
    if not dark.bias.ndim:
        return float(name)
    shutil.copyfile(str(given), folder / f"{dark_name(name)}{Path(str(given)).suffix.lower()}")
    return name


def go_on(folder: Path, watch: Lines, say: Callable[[str], None], config: Path | None) -> Advance:
    """Read the photographs of all rounds so far, score what can be scored, and write the next round if one is needed.

    config: use this config instead of the copy in the session folder (see ``study_of``); say: gets the findings, line
    by line. UserError with every fault of the photographs; nothing is scored then.
    """
    refuse_links_out(folder)
    manifest = read_manifest(folder)
    study = study_of(folder, manifest, config)
    forget_sessions()
    photographer = session_photographer(folder)
    if not manifest.rounds:  # its export was interrupted
        return _advance(study, folder, watch)
    checks = bench_checks(photographer)
    for check in checks:
        say(check.line)
    if not all(check.passed for check in checks):
        raise UserError("nothing was scored. " + " | ".join(check.line for check in checks if not check.passed))
    read: dict[str, str] = {}
    for number in range(1, manifest.rounds + 1):
        faults, captures = photographer.check_round(number)
        if faults:
            raise UserError(f"round {number}: nothing was scored. " + " | ".join(faults))
        read |= captures
        say(f"round {number}: {len(captures)} photographs read")
    for note in photographer.notes:
        say(note)
    try:
        findings = look(_bench(study), photographer, folder / REPORT, say)
    except Pending:
        raise UserError(f"{folder}: round 1 lacks holograms of the fiducial grid; export a new session") from None
    photographer.accept(read)
    notes = [study.note, *photographer.notes, manifest.phase.out_of_reach, *(check.line for check in checks), *findings]
    texts = [note.strip() for note in notes]
    sentences = [f"{text[0].upper()}{text[1:]}{'' if text.endswith('.') else '.'}" for text in texts if text]
    return _advance(replace(study, note=" ".join(sentences)), folder, watch)


def study_of(folder: Path, manifest: Manifest, config: Path | None) -> Study:
    """The study of a session. UserError for another study, or for a copy that may not be trusted.

    A session folder comes from elsewhere, so its copy of the config is used only if everything that it names is
    installed: code in files, datasets in folders and weights need the user's own config.
    """
    path = folder / STUDY if config is None else config
    if not path.is_file() or (config is None and path.is_symlink()):
        raise UserError(f"{path}: no such file; give --study with the config that was exported")
    if digest(load(path).text) != manifest.study_sha256:
        raise UserError(f"{path}: is not the config that this session was exported from")
    if config is None and (reason := _reaches_out(path)):
        raise UserError(f"{path}: {reason}; give --study with your own copy of the config, and these beside it")
    bench = folder / BENCH
    study = _on_one_display(load_study(path), bench if bench.is_file() else None, manifest.display)
    display = next(iter(displays(study).values()))
    if display.digest != manifest.bench_sha256:
        raise UserError(f"'{display.name}' has changed since the session was exported; export a new one")
    if (display.spec.shape, display.spec.wavelengths) != (tuple(manifest.panel), tuple(manifest.wavelengths)):
        raise UserError(f"{folder}: the manifest's panel or wavelengths are not those of '{display.name}'")
    return replace(study, display=replace(study.display, session=folder))


def _stays_inside(name: str) -> bool:
    """Whether a relative path leads nowhere but into the folder that it starts in."""
    return not Path(name).is_absolute() and ".." not in Path(name).parts


def _reaches_out(path: Path) -> str:
    """The files and datasets of a config that are not part of the package or the session; empty if there are none.

    A dataset outside ``OWN`` may read folders; code and profiles in files are recognized by their names. A bench file
    in the session is only read, and its devices are not opened.
    """

    def reached(value: object, *keys: str) -> list[str]:
        if isinstance(value, dict):
            return [reason for name, item in value.items() for reason in reached(item, *keys, str(name))]
        if isinstance(value, list):
            return [reason for item in value for reason in reached(item, *keys)]
        key, text = keys[-1], str(value)
        if key == "dataset" and text not in OWN:
            return [f"dataset: {text[:60]}, which may read any folder"]
        is_in_session = keys == ("display", "bench") and _stays_inside(text) and (path.parent / text).is_file()
        is_prose = key in ("title", "note", "label", "source", "question", "would_change")
        is_file = isinstance(value, str) and (".py:" in text or text.endswith((".yaml", ".yml")) or "/" in text)
        reaches = is_file and not is_in_session and not is_prose
        return [f"{key}: {text[:60]}"] if reaches or key in ("path", "manifest", "lpips_weights", "weights") else []

    found = reached(load(path).data)
    return f"names what is not in the session ({named(found)})" if found else ""


def _on_one_display(study: Study, bench: Path | None, display: str | None) -> Study:
    """The study with a single display, for an exchange of photographs. UserError where that is impossible."""
    if study.measure in STACKS or study.sweeps or study.display.learned:
        stacks = "focal stacks" if study.measure == "focus" else "light fields"
        what = stacks if study.measure in STACKS else "changes of a display" if study.sweeps else "a network"
        raise UserError(f"{study.file}: a session measures pictures on one real display, not {what}")
    if bench is not None:
        grid = replace(study.display, bench=str(bench.resolve()), profiles=(), panel=None)
    elif study.display.bench:
        grid = study.display
    else:
        grid = replace(study.display, profiles=(_profile(study, display),))
    source = grid.sources[0]
    kept = study.with_methods(
        replace(entry, profiles=(source,))
        for entry in study.methods
        if (bench is not None or source in entry.profiles) and not isolation.traits(entry.name, study.folder).privileged
    )
    if not kept.methods:
        raise UserError(f"{study.file}: no method of it can be shown on a real display")
    reported = kept.reported and replace(kept.reported, beside=None)
    return replace(kept, display=grid, baseline=kept.baseline or kept.labels[0], reported=reported)


def _profile(study: Study, display: str | None) -> str:
    """The profile of a display's name. UserError if the name is unknown, or missing with several displays."""
    names = {condition(profile, study.display.panel, study.folder).name: profile for profile in study.display.profiles}
    if display is None and len(names) > 1:
        raise UserError(f"{study.file}: several displays; choose one with --display, or describe yours with --bench")
    chosen = display or next(iter(names))
    if chosen not in names:
        raise UserError(f"unknown display '{chosen}'; {suggest(chosen, names)}")
    return names[chosen]


def _bench(study: Study) -> RealBench:
    bench = open_display(next(iter(displays(study).values())), study.seed)
    assert isinstance(bench, RealBench)
    return bench


def _advance(study: Study, folder: Path, watch: Lines) -> Advance:
    """Compute what can be computed; write the patterns of what waits. study: on the display of the session."""
    _bench(study).announce_grid()
    photographer = session_photographer(folder)
    outcome = run(study, plan(study), folder / REPORT, Serial(), watch, 1, folder / ARTIFACTS, retry_failed=True)
    methods = [isolation.traits(entry.name, study.folder) for entry in study.methods]
    takes_rounds = "matched" in {entry.exposure for entry in study.methods}  # or a hologram depends on photographs
    takes_rounds |= any(method.trains or method.camera or method.follows for method in methods)
    if photographer.wanted and photographer.manifest.rounds and not takes_rounds:
        fault = f"other holograms are computed here than were photographed, and {REPORT}/solved lacks those"
        remedy = "bring the whole folder of the session from where it was exported, or import it there"
        raise UserError(f"{folder}: {fault}; {remedy}")
    patterns = photographer.write_round() if photographer.wanted else []
    return Advance(study, tuple(patterns), outcome)
