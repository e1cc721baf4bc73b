"""``holoeval score``: photographs that somebody took, scored against their targets without any fiducial."""

from __future__ import annotations

import itertools
import os
import shlex
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ..core.errors import UserError, listed, suggest
from .output import console as open_console
from .output import print_answer, print_headline

if TYPE_CHECKING:
    from ..report import Results

# How files are read.
VALUES = {
    "stored": "captures and targets are compared as they are stored, as pictures that are both sRGB. Captures that "
    "count light (raw, without a gamma) need --values linear",
    "srgb": "captures and targets are decoded from sRGB to linear light. Captures that count light (raw, without a "
    "gamma) need --values linear",
    "linear": "captures are taken as linear light, and targets are decoded from sRGB to it. Captures that were encoded "
    "by the camera, as JPEGs are, need --values srgb or stored",
}


def score(
    captures: Annotated[Path, typer.Option(help="Folder with captures, METHOD/TARGET.png.")],
    targets: Annotated[Path, typer.Option(help="Folder with targets, TARGET.png.")],
    output: Annotated[Path, typer.Option(help="Where to write the report.")],
    values: Annotated[str, typer.Option(help="Values in the files: stored (as they are), srgb or linear.")] = "stored",
    baseline: Annotated[str | None, typer.Option(help="The method that others are tested against.")] = None,
    visible: Annotated[
        bool, typer.Option("--visible", help="Score the part of a target that all its captures show.")
    ] = False,
    aligned: Annotated[
        bool, typer.Option("--aligned", help="The captures lie on their targets already, pixel to pixel.")
    ] = False,
    dark: Annotated[
        str | None,
        typer.Option(metavar="FILE|LEVEL", help="Counts without light, taken off the captures (with --values linear)."),
    ] = None,
    lpips_weights: Annotated[Path | None, typer.Option(help="File or folder of the LPIPS trunk.")] = None,
) -> None:
    """Score pictures that were taken long ago: align each with its target by what it shows, and write a report."""
    weights = None if lpips_weights is None else str(lpips_weights)
    console = open_console()
    report, results = score_folders(
        captures, targets, output, values, baseline, weights, console, visible, aligned, dark
    )
    print_headline(console, results)
    for hole in results.holes.to_dict("records"):
        text = f"{hole['state']}: {hole['label']} · {hole['target']}: {hole['reason']}"
        console.print(text, style="red", markup=False, soft_wrap=True)
    print_answer(console, results)
    print(f"{report}\n{output / 'report.html'}\n{output / 'table.csv'}\n{output / 'records.csv'}")
    raise typer.Exit(1 if len(results.holes) else 0)


def score_folders(
    captures: Path,
    targets: Path,
    output: Path,
    values: str,
    baseline: str | None,
    lpips_weights: str | None,
    console: Console,
    visible: bool = False,
    aligned: bool = False,
    dark: str | None = None,
) -> tuple[Path, Results]:
    """Score ``captures/<method>/<target>.png`` against ``targets/<target>.png``: path and numbers of the report.

    visible, aligned: as in `Scoring`; dark: counts without light, a level or a file.

    What was computed before in ``output`` for the same files by the same code is taken from there. UserError for input
    that cannot be used, in one line; a capture that cannot be aligned is a hole in the report, with its reason.
    """
    from ..lab.dark import given_dark
    from ..report import Description, write_report
    from ..report.charts.alignment import draw_alignment
    from ..report.facts import facts_of_files
    from ..study.folders.doubts import doubts
    from ..study.folders.files import read_folders
    from ..study.folders.scoring import CONDITION, Scoring, described
    from ..study.running import provenance
    from ..study.store import Store

    options = {"--captures": captures, "--targets": targets, "--output": output, "--values": values}
    options |= {"--visible": visible, "--aligned": aligned, "--baseline": baseline, "--dark": dark}
    _refuse(options)
    taken_off, told = (None, "") if dark is None else given_dark(dark, upright=True)
    folders = read_folders(captures, targets, values == "linear", taken_off)
    if baseline is not None and baseline not in folders.methods:
        raise UserError(f"--baseline {baseline}: no such folder of captures; {suggest(baseline, folders.methods)}")
    scoring = Scoring(folders, Store(output), values, lpips_weights, draw_alignment, visible, aligned, told)
    with scoring.store.locked():
        known = provenance.begin(output, described(folders, values, told), resumed=True)
        console.print(f"--values {values}: {VALUES[values]}.", markup=False, soft_wrap=True)
        with _steps(console, 2 * len(folders.captures) + len(folders.targets)) as step:
            found = scoring.records(step)
        records = [record.row(record.capture) for record in found]
        notes = [*folders.notes, *_in_part(records), *doubts(found, folders, scoring.domain)]
        for note in notes:
            console.print(note, markup=False, soft_wrap=True)
        known = provenance.end(output, known)
        title = f"Scores of photographs: {listed(folders.methods)}"
        pairs = [(method, CONDITION) for method in folders.methods]
        facts = facts_of_files(
            output.resolve().name, title, pairs, tuple(folders.targets), values, " ".join(notes), baseline
        )
        given = {name: value for name, value in options.items() if value not in (None, False, "")}
        words = [word for name, value in given.items() for word in (name, *([] if value is True else [str(value)]))]
        command = shlex.join(["holoeval", "score", *words])
        return write_report(facts, records, output, known, Description(command=command))


def _refuse(options: Mapping[str, Any]) -> None:
    """UserError for options that do not go together."""
    output, values, dark = options["--output"], options["--values"], options["--dark"]
    if values not in VALUES:
        raise UserError(f"--values {values}: {suggest(values, VALUES)}")
    for source in (options["--captures"], options["--targets"]):
        if Path(os.path.realpath(output)).is_relative_to(os.path.realpath(source)):
            mixed = f"lies in {source}, whose files it would mix with"
            raise UserError(f"--output {output}: {mixed}; expected another folder")
    if options["--visible"] and options["--aligned"]:
        raise UserError("--visible --aligned: an aligned capture shows all of its target; expected one of the two")
    if dark is not None and values != "linear":
        encoded = "is taken off counts of light, not off encoded values"
        raise UserError(f"--dark {dark}: {encoded}; expected --values linear")


def _in_part(records: list[dict[str, Any]]) -> Iterator[str]:
    """A sentence for each target of which a part is scored: how large it is, and what each capture shows."""
    parts: dict[str, list[tuple[str, dict[str, float]]]] = {}
    for record in records:
        if record["scores"].get("share_scored", 1.0) < 1:
            parts.setdefault(record["cell"]["target"], []).append((record["label"], record["scores"]))
    for target, captures in parts.items():
        seen = ", ".join(f"{label} {scores['share_seen']:.1%}" for label, scores in captures)
        share = captures[0][1]["share_scored"]
        yield f"Of {target}, {share:.1%} is scored, which all its captures show. Seen of it: {seen}."


@contextmanager
def _steps(console: Console, total: int) -> Iterator[Callable[[str], None]]:
    """Show every step by its name: a bar on a terminal, else a line every few seconds."""
    from ..study.running.progress import seldom

    if console.is_terminal:
        text = TextColumn("{task.description}", markup=False)
        with Progress(text, BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), console=console) as progress:
            bar = progress.add_task("reading", total=total, completed=-1)
            yield lambda name: progress.update(bar, description=name, advance=1)
        return
    is_due, steps = seldom(), itertools.count()

    def line(name: str) -> None:
        done = next(steps)
        if is_due():
            console.print(f"{done}/{total} steps; now {name}", markup=False, soft_wrap=True)

    yield line
