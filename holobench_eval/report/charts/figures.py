"""Every figure of a report: which there are, what is on them, and the captions they carry in report.md."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from ...study.folders import alignment_name
from ...study.plan import REFERENCE
from ...study.store import Store
from ..data.ranks import ranks
from ..data.results import Results
from ..data.sweeps import sweeps
from ..data.tables import DONE
from ..sections.tables import label, leading_scores
from ..sections.training import Trained
from . import frontiers, sweep_figures
from . import ranks as figure_ranks
from .charts import Chart, quality_bars, target_dots
from .comparison import draw_comparison, tile_size
from .gallery import Column, Picture, Tile, chunks, error_ceiling, error_map, load_picture, spread
from .style import slugs
from .training import draw_trainings

FOLDER = "figures"
TARGETS_SHOWN = 4
TARGETS_A_PAGE = 4
METHODS_A_PAGE = 8
ALIGNMENTS_SHOWN = 8
PIXELS = 5e6
"""Pixels of all comparison pages of a condition, at most: full-panel captures are shown for fewer targets."""


@dataclass(frozen=True)
class Drawn:
    """A figure that was written: its path relative to the report, what a reader should know of it, its number."""

    path: str
    caption: str
    number: int = 0


@dataclass(frozen=True)
class Figures:
    """The figures of a report by kind, and the thumbnails that were wanted and not there."""

    charts: list[Drawn]
    frontiers: list[Drawn]
    sweeps: list[Drawn]
    ranks: list[Drawn]
    comparisons: list[Drawn]
    stages: list[Drawn]
    alignments: list[Drawn]
    trainings: list[Drawn]
    absent: list[str]


def draw_figures(results: Results, trained: Sequence[Trained], output: Path) -> Figures:
    """Draw everything that the records allow into ``output/figures``; older figures of the same kinds go."""
    folder = output / FOLDER
    for pattern in ("comparison-*.jpg", "sweep-*.jpg", "quality-*.png", "training-*.png"):
        for old in folder.glob(pattern):
            old.unlink()
    absent: list[str] = []
    comparisons = [
        drawn
        for condition, stem in slugs(results.conditions).items()
        for drawn in _comparison(results, output, condition, stem, absent)
    ]
    number = itertools.count(1)
    kinds = (
        _charts(results, folder),
        [Drawn(f"{FOLDER}/{path.name}", caption) for path, caption in frontiers.draw(results, folder)],
        _sweeps(results, output, absent),
        [Drawn(f"{FOLDER}/{path.name}", caption) for path, caption in figure_ranks.draw(ranks(results), folder)],
        comparisons,
        _stages(results, folder),
        _alignments(results, folder),
        _trainings(trained, folder),
    )
    charts, costs, changes, stability, captures, stages, alignments, trainings = (
        [replace(drawn, number=next(number)) for drawn in kind] for kind in kinds
    )
    return Figures(charts, costs, changes, stability, captures, stages, alignments, trainings, sorted(set(absent)))


def _sweeps(results: Results, output: Path, absent: list[str]) -> list[Drawn]:
    """Curves, and rows of the target in the middle of the ranking of targets."""
    every, store = sweeps(results), Store(output)
    pictures = {target: load_picture(store.target_thumbnail(target)) for target in results.targets}
    known = {target: picture for target, picture in pictures.items() if picture is not None}
    middle = None
    if every and known:
        name = _by_quality(results, results.conditions[0], list(known))[len(known) // 2]
        middle = (name, known[name])

    def take(label: str, condition: str, target: str) -> Tile:
        return _tile(results, store, (label, condition, target), known[target].shape, absent)

    drawn = sweep_figures.draw(every, output / FOLDER, take, middle)
    return [Drawn(f"{FOLDER}/{path.name}", caption) for path, caption in drawn]


def _charts(results: Results, folder: Path) -> list[Drawn]:
    score = results.headline
    table = results.table[results.table["condition"].isin(results.conditions)]
    if score.key not in table or not np.isfinite(table[score.key]).any():
        return []
    methods = tuple(dict.fromkeys(table["method"]))
    said, shown = results.layout.wording, results.conditions
    floors = {
        said.floor_name(name): float(results.row(name, REFERENCE)[score.key])
        for name in ("floor_constant", "floor_speckle")
        if name in results.floors and all(map(results.has_floor, shown))
    }
    chart = Chart(score, methods, results.layout.privileged, floors, said.axis)
    quality_bars(folder / "quality-bars.png", table, chart)
    lines = f"{' Vertical lines: the floor.' * bool(floors)}{' Hatched: the ceiling.' * bool(chart.privileged)}"
    bars = f"{chart.axis}, by method and display. Mean over targets with its 95 % interval.{lines}"
    drawn = [Drawn(f"{FOLDER}/quality-bars.png", bars)]
    values = {
        condition: pd.DataFrame(
            {name: results.values(name, condition) for name in results.methods(condition)}, index=results.targets
        ).dropna(axis=1, how="all")
        for condition in results.conditions
    }
    values = {condition: frame for condition, frame in values.items() if not frame.empty}
    target_dots(folder / "quality-by-target.png", values, chart)
    dots = "A dot is a target, a line joins the same target across methods (a gap is a hole), a bar is the mean."
    drawn.append(Drawn(f"{FOLDER}/quality-by-target.png", f"{chart.axis}, of every target. {dots}"))
    return drawn


def _trainings(trained: Sequence[Trained], folder: Path) -> list[Drawn]:
    found = [(one.name, one.record.rounds) for one in trained if one.record]
    drawn = []
    for path, curves in draw_trainings(folder / "training", found):
        what = "Training: PSNR on held-out images of the predicted and of the captured picture against the target, and "
        how = "against the captures taken, a mark per round." if curves else "after the last round, a row per training."
        drawn.append(Drawn(f"{FOLDER}/{path.name}", f"{what}of the prediction against the capture (fidelity), {how}"))
    return drawn


def _comparison(results: Results, output: Path, condition: str, stem: str, absent: list[str]) -> Iterator[Drawn]:
    if not results.has_pictures(condition):
        return
    store = Store(output)
    pictures = {target: load_picture(store.target_thumbnail(target)) for target in results.targets}
    absent += [store.target_thumbnail(target).name for target, picture in pictures.items() if picture is None]
    targets = {target: picture for target, picture in pictures.items() if picture is not None}
    methods, said = results.methods(condition), results.layout.wording
    if not targets or not methods:
        return
    sheets = _sheets(results, condition, targets)
    shown = [target for sheet in sheets for target in sheet]
    tiles = {
        (name, target): _tile(results, store, (name, condition, target), targets[target].shape, absent)
        for name in methods
        for target in shown
    }
    errors = [error_map(tile.picture, targets[key[1]]) for key, tile in tiles.items() if tile.picture is not None]
    if not errors:
        return
    pages = [(a, b) for a in sheets for b in chunks(methods, METHODS_A_PAGE)]
    scale = error_ceiling(errors)
    for number, (rows, labels) in enumerate(pages, start=1):
        columns = [Column(label(results, name), tuple(tiles[name, row] for row in rows)) for name in labels]
        page = f", page {number} of {len(pages)}" if len(pages) > 1 else ""
        path = f"{FOLDER}/comparison-{stem}-{number}.jpg"
        title = f"{condition}: {said.truth}s and matched {said.scored}s{page}"
        draw_comparison(output / path, title, [(row, targets[row]) for row in rows], columns, scale, said.truth)
        yield Drawn(path, _caption(results, condition, page, len(shown)))


def _caption(results: Results, condition: str, page: str, shown: int) -> str:
    total, said = len(results.targets), results.layout.wording
    chosen = "every target" if shown == total else f"{shown} of {total} targets, evenly spaced from worst to best"
    return (
        f"{said.scored.capitalize()}s on {condition}{page}: {chosen}. {said.picture}; below, the most detailed window "
        f"of the {said.truth} enlarged twice as much, and the absolute error against the {said.truth} in sRGB."
    )


def _sheets(results: Results, condition: str, targets: dict[str, Picture]) -> list[list[str]]:
    """The targets of each page: of focal stacks every plane, a scene a page."""
    planes = results.layout.planes
    if not planes:
        pages = chunks(_selection(results, condition, targets), TARGETS_A_PAGE)
        return [group for page in pages for group in _of_one_size(page, targets)]
    stacks = [[t for t in targets if planes[t][0] == scene] for scene in dict.fromkeys(planes[t][0] for t in targets)]
    return [sheet for stack in stacks for sheet in chunks(stack, TARGETS_A_PAGE)]


def _of_one_size(names: Sequence[str], targets: dict[str, Picture]) -> list[list[str]]:
    """The targets in groups that one page can show; pictures that were given as files may differ in size."""
    groups: dict[tuple[int, ...], list[str]] = {}
    for name in names:
        groups.setdefault(targets[name].shape, []).append(name)
    return list(groups.values())


def _selection(results: Results, condition: str, targets: dict[str, Picture]) -> list[str]:
    """All targets if they fit; else evenly spaced ones from worst to best by their mean over methods."""
    tall, wide = tile_size(next(iter(targets.values())).shape)
    row = 1.5 * tall * wide * (1 + len(results.methods(condition)))
    most = int(min(TARGETS_SHOWN, max(2, PIXELS // row)))
    if len(targets) <= most:
        return list(targets)
    return spread(_by_quality(results, condition, list(targets)), most)


def _by_quality(results: Results, condition: str, targets: Sequence[str]) -> list[str]:
    """Targets from worst to best by their mean over methods."""
    values = np.vstack([results.values(name, condition) for name in results.methods(condition)])
    known = np.isfinite(values)
    means = np.where(known, values, 0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    sign = 1 if results.headline.higher_is_better else -1
    quality = dict(zip(results.targets, sign * means, strict=True))
    return sorted(targets, key=lambda target: quality[target])


def _tile(results: Results, store: Store, place: tuple[str, str, str], shape: Sequence[int], absent: list[str]) -> Tile:
    """The capture of the first repeat that is done, with its own scores; without one, the reason in its place."""
    name, condition, target = place
    cells = results.cells(name, condition)
    cells = cells[cells["target"] == target]
    if cells.empty:
        return Tile(None, "not planned")
    done = cells[cells["state"] == DONE]
    if done.empty:
        return Tile(None, f"{cells.iloc[0]['state']}: {cells.iloc[0]['reason']}")
    cell = done.iloc[0]
    file = store.thumbnail(str(cell["cell"]))
    picture = load_picture(file)
    if picture is None:
        absent.append(file.name)
        return Tile(None, "no thumbnail of this capture")
    if picture.shape != tuple(shape):
        return Tile(None, f"thumbnail is {picture.shape[1]} x {picture.shape[0]}, target {shape[1]} x {shape[0]}")
    scores = [results.headline, *(s for s in leading_scores(results) if s.metric == "ssim")][:2]
    return Tile(picture, "   ".join(f"{s.title} {s.with_unit(float(cell[s.key]))}" for s in scores))


def _stages(results: Results, folder: Path) -> list[Drawn]:
    """Pictures of the bench's stages, drawn elsewhere, where they are."""
    profiles = [name for name in dict.fromkeys(results.frame["profile"]) if name]
    found = [name for name in profiles if (folder / f"stages-{name}.png").is_file()]
    return [Drawn(f"{FOLDER}/stages-{name}.png", f"Stages of the simulated bench {name}.") for name in found]


def _alignments(results: Results, folder: Path) -> list[Drawn]:
    """Pictures of captures that were aligned with their targets, drawn elsewhere, where they are; the first so many."""
    done = results.frame[results.frame["state"] == DONE]
    places = [(method, target) for method, target in zip(done["method"], done["target"], strict=True)]
    found = [(name, *place) for place in places if (folder / (name := alignment_name(*place))).is_file()]
    more = f" {len(found) - ALIGNMENTS_SHOWN} more are in `{FOLDER}/`." if len(found) > ALIGNMENTS_SHOWN else ""
    return [
        Drawn(
            f"{FOLDER}/{name}",
            f"{method}, {target}: the outline of the target on the capture, a dot at the target's upper left corner; "
            f"and squares of the target and of the aligned, matched capture in turn.{more}",
        )
        for name, method, target in found[:ALIGNMENTS_SHOWN]
    ]
