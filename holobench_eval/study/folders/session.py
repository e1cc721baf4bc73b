"""A study on a bench that other software drives: ``holoeval session export`` and ``import``, round by round."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from ...core.errors import Pending, UserError, suggest
from ...core.hashing import digest
from ...core.io import write_atomically
from ...core.yaml_source import load
from ...imaging.convention import Convention
from ...lab.bench_file import load_bench_file
from ...lab.live import letter
from ...lab.real import RealBench
from ...lab.session import Manifest, Pattern, read_manifest, session_photographer, write_manifest
from ...lab.session.bench_checks import bench_checks
from ...lab.session.geometry import look
from ...lab.session.manifest import refuse_links_out
from .. import isolation
from ..config import load_study
from ..definition import Study
from ..displays import condition, displays, real_condition
from ..executors import Serial
from ..opening import forget_sessions, open_display
from ..plan import plan
from ..progress import Lines
from ..run import Outcome, run

STUDY, BENCH, REPORT, ARTIFACTS = "study.yaml", "bench.yaml", "report", "artifacts"

NAMED = 5  # files of a config that one line names
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
    threads: int,
    bench: Path | None = None,
    display: str | None = None,
    fixed_exposure: bool = False,
) -> Advance:
    """Make a session folder for a study and write its first round of patterns.

    bench: file of the real bench; without it ``display``, one of the study's profiles, gives the nominal optics
    (optional if the study has a single profile), and the panel's levels have the default convention.
    UserError: the folder is not empty, or the study cannot be shown on one real display.
    """
    if folder.exists() and any(folder.iterdir()):
        raise UserError(f"{folder}: not empty; give a new folder, or go on there with holoeval session import {folder}")
    study = load_study(config)
    chosen = _on_one_display(study, bench, display)
    if fixed_exposure and "matched" in {chosen.display.exposure, *(entry.exposure for entry in chosen.methods)}:
        raise UserError(f"{config}: exposure: matched sets exposures one by one; not with --fixed-exposure")
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / STUDY, chosen.text.encode())
    named = study.display.bench
    if bench is not None:
        shutil.copyfile(bench, folder / BENCH)
    if bench is None and named and _stays_inside(named):
        if (folder / named).exists():
            raise UserError(f"{named}: a session has a file of this name of its own; rename the bench file")
        (folder / named).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(study.folder / named, folder / named)
    real_display = next(iter(displays(chosen).values()))
    spec, described = real_display.spec, real_display.digest
    if spec.bits != 8:
        raise UserError(f"'{real_display.name}' has {spec.bits} bits; patterns are written with 8")
    described_bench = real_display.real.bench if real_display.real else None
    text = digest(chosen.text)
    manifest = Manifest(
        format=1,
        session=digest([text, described, str(config), digest(folder.resolve().as_posix())]),
        study_sha256=text,
        bench_sha256=described,
        display=real_display.name,
        panel=spec.shape,
        wavelengths=spec.wavelengths,
        phase=load_bench_file(described_bench).phase if described_bench else Convention(),
        fixed_exposure=fixed_exposure,
    )
    write_manifest(folder, manifest)
    forget_sessions()
    session_photographer.cache_clear()
    opened = replace(chosen, display=replace(chosen.display, session=folder))
    session_photographer(folder).write_checks(letter(_bench(opened)).phase)
    return _advance(chosen, folder, watch, threads)


def go_on(folder: Path, watch: Lines, threads: int, say: Callable[[str], None], config: Path | None = None) -> Advance:
    """Read the photographs of all rounds so far, score what can be scored, and write the next round if one is needed.

    config: use this config instead of the copy in the session folder (see ``study_of``); say: gets the findings, line
    by line. UserError with every fault of the photographs; nothing is scored then.
    """
    refuse_links_out(folder)
    manifest = read_manifest(folder)
    study = study_of(folder, manifest, config)
    forget_sessions()
    session_photographer.cache_clear()
    photographer = session_photographer(folder)
    if not manifest.rounds:  # its export was interrupted
        return _advance(study, folder, watch, threads)
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
    notes = [study.note, *photographer.notes, *(check.line for check in checks), *findings]
    advance = _advance(study, folder, watch, threads)
    return replace(advance, study=replace(advance.study, note=" ".join(_sentence(note) for note in notes if note)))


def _sentence(note: str) -> str:
    text = note.strip()
    return f"{text[0].upper()}{text[1:]}{'' if text.endswith('.') else '.'}"


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
    study = load(path).data
    display = study.get("display")
    bench = display.get("bench") if isinstance(display, dict) else None
    if (
        isinstance(display, dict)
        and isinstance(bench, str)
        and _stays_inside(bench)
        and (path.parent / bench).is_file()
    ):
        study = {**study, "display": {key: value for key, value in display.items() if key != "bench"}}

    def walk(value: object, key: str) -> list[str]:
        if isinstance(value, dict):
            return [reason for name, item in value.items() for reason in walk(item, str(name))]
        if isinstance(value, list):
            return [reason for item in value for reason in walk(item, key)]
        file = isinstance(value, str) and (".py:" in value or value.endswith((".yaml", ".yml")) or "/" in value)
        is_prose = key in ("title", "note", "label", "source", "question", "would_change")
        reaches = (file and not is_prose) or key in ("path", "manifest", "lpips_weights", "weights")
        return [f"{key}: {str(value)[:60]}"] if reaches else []

    named = walk(study, "")
    for section in ("targets", "training"):
        entry = study.get(section)
        dataset = entry.get("dataset", "dead_leaves") if isinstance(entry, dict) else "dead_leaves"
        if dataset not in OWN and f"dataset: {dataset}" not in named:
            named.append(f"dataset: {str(dataset)[:60]}, which may read any folder")
    more = f" and {len(named) - NAMED} more" if len(named) > NAMED else ""
    return f"names what is not in the session ({'; '.join(named[:NAMED])}{more})" if named else ""


def _on_one_display(study: Study, bench: Path | None, display: str | None) -> Study:
    """The study with a single display, for an exchange of photographs. UserError where that is impossible."""
    if study.measure == "focus" or study.sweeps or study.display.learned:
        what = "focal stacks" if study.measure == "focus" else "changes of a display" if study.sweeps else "a network"
        raise UserError(f"{study.file}: a session measures pictures on one real display, not {what}")
    if bench is not None:
        grid = replace(study.display, bench=str(bench.resolve()), profiles=(), panel=None)
        real_condition(str(bench.resolve()), study.folder)
    elif study.display.bench:
        grid = study.display
    else:
        grid = replace(study.display, profiles=(_profile(study, display),))
    source = grid.sources[0]
    methods = tuple(
        replace(entry, profiles=(source,))
        for entry in study.methods
        if (bench is not None or source in entry.profiles) and not isolation.traits(entry.name, study.folder).privileged
    )
    if not methods:
        raise UserError(f"{study.file}: no method of it can be shown on a real display")
    labels = {entry.label for entry in methods}
    baseline = study.baseline if study.baseline in labels else methods[0].label
    reported = None
    if study.reported is not None:
        rows = {label: row for label, row in study.reported.rows.items() if label in labels}
        reported = replace(study.reported, rows=rows, beside=None)
    return replace(study, display=grid, methods=methods, baseline=baseline, reported=reported)


def _profile(study: Study, display: str | None) -> str:
    """The profile of a display's name. UserError if the name is unknown, or missing with several displays."""
    names = {condition(profile, study.display.panel, study.folder).name: profile for profile in study.display.profiles}
    if display is None and len(names) > 1:
        raise UserError(f"{study.file}: several displays; choose one with --display, or describe yours with --bench")
    if display is None:
        return study.display.profiles[0]
    if display not in names:
        raise UserError(f"unknown display '{display}'; {suggest(display, names)}")
    return names[display]


def _bench(study: Study) -> RealBench:
    bench = open_display(next(iter(displays(study).values())), study.seed)
    assert isinstance(bench, RealBench)
    return bench


def _advance(study: Study, folder: Path, watch: Lines, threads: int) -> Advance:
    """Compute what can be computed; write the patterns of what waits."""
    study = replace(study, display=replace(study.display, session=folder))
    _bench(study).announce_grid()
    photographer = session_photographer(folder)
    outcome = run(study, plan(study), folder / REPORT, Serial(), watch, threads, folder / ARTIFACTS, retry_failed=True)
    if photographer.wanted and photographer.manifest.rounds and not _takes_rounds(study):
        raise UserError(
            f"{folder}: other holograms are computed here than were photographed, and {REPORT}/solved lacks those; "
            "bring the whole folder of the session from where it was exported, or import it there"
        )
    patterns = photographer.write_round() if photographer.wanted else []
    return Advance(study, tuple(patterns), outcome)


def _takes_rounds(study: Study) -> bool:
    """Whether a hologram of the study may depend on photographs of others."""
    methods = [isolation.traits(entry.name, study.folder) for entry in study.methods]
    exposures = {study.display.exposure, *(entry.exposure for entry in study.methods)}
    return "matched" in exposures or any(method.trains or method.camera or method.follows for method in methods)
