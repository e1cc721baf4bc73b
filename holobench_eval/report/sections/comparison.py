"""Captures to look at: targets down, methods across; and the stages of the bench that made them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ..charts.comparison import ZOOM, draw_comparison, tile_size
from ..charts.gallery import Column, chunks, error_limit, error_map, most_detailed, spread
from ..charts.style import slugs
from ..data import over_displays
from ..data.categories import OFFLINE, ONLINE
from ..data.results import Results
from ..markdown import heading
from ..section import Blocks, Figures, Report, Section

TARGETS_SHOWN = 2  # of focal stacks: the planes of one scene
TARGETS_A_PAGE = 4
METHODS_A_PAGE = 4
PIXELS = 1e6  # of a page, about: of full-panel captures a single target is drawn
ABSENT_NAMED = 6


def _render(report: Report, figures: Figures) -> Blocks:
    text, absent = report.layout.text, sorted(report.thumbnails.absent)
    yield heading(f"{text.scored.capitalize()}s to look at")
    yield from figures
    if not figures:
        yield f"There is no comparison figure: thumbnails of {text.scored}s are missing."
    if absent:
        named = ", ".join(absent[:ABSENT_NAMED]) + (", and others" if len(absent) > ABSENT_NAMED else "")
        yield f"Missing thumbnails ({len(absent)}): {named}."


def _figures(report: Report) -> Iterator[tuple[Path, str]]:
    many = over_displays.applies(report.results)  # of many displays, the first stands for all
    for condition, stem in list(slugs(report.results.conditions).items())[: 1 if many else None]:
        if report.results.has_pictures(condition) and report.thumbnails.targets(condition):
            yield from _comparison(report, condition, stem)


def _comparison(report: Report, condition: str, stem: str) -> Iterator[tuple[Path, str]]:
    results, thumbnails, text = report.results, report.thumbnails, report.layout.text
    targets, methods = thumbnails.targets(condition), _best_first(results, condition)
    sheets = pages_of_targets(report, condition)
    drawn = [target for sheet in sheets for target in sheet]
    tiles = {(name, target): thumbnails.tile(name, condition, target) for name in methods for target in drawn}
    windows = {target: most_detailed(targets[target]) for target in drawn}
    errors = [
        error_map(windows[target].of(tile.picture), windows[target].of(targets[target]))
        for (_, target), tile in tiles.items()
        if tile.picture is not None
    ]
    if not errors:
        return
    pages = [(rows, labels) for rows in sheets for labels in chunks(methods, METHODS_A_PAGE)]
    for number, (rows, labels) in enumerate(pages, start=1):
        columns = [Column(report.layout.marked(name), tuple(tiles[name, row] for row in rows)) for name in labels]
        page = f", page {number} of {len(pages)}" if len(pages) > 1 else ""
        path = report.figures / f"comparison-{stem}-{number}.jpg"
        title = f"{condition}: {text.truth}s and matched {text.scored}s{page}"
        draw_comparison(path, title, [(row, targets[row]) for row in rows], columns, error_limit(errors), text.truth)
        yield path, _caption(results, page, condition, drawn)


def _best_first(results: Results, condition: str) -> list[str]:
    """The methods of a display: the best, the baseline and the oracle, which share the first page, then the others."""
    first = [
        *results.ranking(condition, categories=(*OFFLINE, ONLINE))[:1],
        results.layout.baseline,
        results.oracle(condition),
    ]
    methods = results.methods(condition)
    return list(dict.fromkeys([*(label for label in first if label in methods), *methods]))


def _caption(results: Results, page: str, condition: str, drawn: list[str]) -> str:
    total, planes, text = len(results.targets), results.layout.planes, results.layout.text
    if planes:
        chosen = f"every plane of {planes[drawn[0]][0]}"
    elif len(drawn) == total:
        chosen = "every target"
    else:
        chosen = f"{len(drawn)} of {total} targets, evenly spaced from worst to best"
    return (
        f"{text.scored.capitalize()}s on {condition}{page}: {chosen}. {text.picture}; below, the most detailed window "
        f"of the {text.truth} at {ZOOM} times the scale, and in it the absolute error against the {text.truth} in sRGB."
    )


def pages_of_targets(report: Report, condition: str) -> list[list[str]]:
    """The targets of each page, all of one size. Of focal stacks: every plane of a scene of medium quality."""
    planes, targets = report.layout.planes, report.thumbnails.targets(condition)
    if planes:
        scene = planes[report.thumbnails.middle(condition)][0]
        return list(chunks([target for target in targets if planes[target][0] == scene], TARGETS_A_PAGE))
    pages = chunks(_selection(report, condition), TARGETS_A_PAGE)
    return [group for page in pages for group in _grouped({target: targets[target].shape for target in page})]


def _grouped(keys: dict[str, object]) -> list[list[str]]:
    """Names with equal keys together."""
    groups: dict[object, list[str]] = {}
    for name, key in keys.items():
        groups.setdefault(key, []).append(name)
    return list(groups.values())


def _selection(report: Report, condition: str) -> list[str]:
    """All targets if they fit; else evenly spaced ones from worst to best by their mean over methods."""
    targets = report.thumbnails.targets(condition)
    tall, wide = tile_size(next(iter(targets.values())).shape)
    row = 1.5 * tall * wide * (1 + min(METHODS_A_PAGE, len(report.results.methods(condition))))
    most = int(min(TARGETS_SHOWN, max(1, PIXELS // row)))
    if len(targets) <= most:
        return list(targets)
    return spread(report.thumbnails.by_quality(condition), most)


def _stages(report: Report) -> Iterator[tuple[Path, str]]:
    """Pictures of the bench's stages, drawn before the report, where they are."""
    for name in dict.fromkeys(report.results.frame["display"]):
        path = report.figures / f"stages-{name}.png"
        if path.is_file():
            yield path, f"Stages of the simulated bench {name}."


SECTIONS = (
    Section(
        "comparison",
        80,
        _render,
        figures=lambda report: report.pictures("comparison-*.jpg", lambda: _figures(report)),
        details=True,
    ),
    Section("stages", 90, lambda _, figures: figures, figures=_stages, details=True),
)
