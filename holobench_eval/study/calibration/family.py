"""A family of displays that could be one that nobody measured: draws from what is known of it, and those whose captures
have the figures that were published.

Approximate Bayesian computation by rejection (Pritchard et al. 1999, Mol. Biol. Evol. 16, 1791).
"""

from __future__ import annotations

import csv
import hashlib
import json
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from statistics import fmean
from typing import Annotated, Any

import torch
from annotated_types import Interval, MinLen
from torch import Tensor

from ...core import plugins
from ...core.errors import CellError, UserError, suggest
from ...core.io import locked, write_atomically
from ...core.schema import typed
from ...core.seeds import generator, seed
from ...core.yaml_source import load
from ...display import Profile, load_profile
from ...metrics import score
from ..artifacts import packed
from ..definition import Targets
from ..executors import Executor
from ..opening import open_bench
from ..versions import HARNESS, dataset_version, method_version
from . import hologram, with_values

FOLDER = Path(__file__).parent / "families"
METRICS, DOMAINS = ("psnr", "ssim"), ("linear", "srgb")
DIGITS = 4  # of a drawn value
TARGETS = "targets"
Row = Mapping[str, float]
Holograms = dict[str, dict[str, Tensor]]
"""Phases [rad] by method and image, and under ``TARGETS`` the images."""


@dataclass(frozen=True)
class Range:
    """What a parameter is drawn from, evenly. name: ``stage.key`` of the profile; unit: empty for none; source: where
    the range comes from."""

    name: str
    words: str
    low: float
    high: float
    unit: str
    source: str


@dataclass(frozen=True)
class Outside:
    """Effects outside every model's form. share: of the draws that have them."""

    share: Annotated[float, Interval(ge=0, le=1)]
    parameters: tuple[Range, ...]


@dataclass(frozen=True)
class Family:
    """What is drawn, and what captures have to be.

    base: profile of all that is not drawn; panel: rows and columns [px]; seed: of draws, patterns and noise;
    targets: the images; figures: PSNR [dB] and SSIM of captures, by method; tolerance: how far from it the mean
    over the images may be; members: how many displays are kept; geometries: parameters that methods are told, one of
    which is drawn; parameters: drawn for all; outside: for some.
    """

    base: str
    panel: tuple[int, int]
    seed: int
    targets: Targets
    figures: Annotated[Mapping[str, Mapping[str, float]], MinLen(1)]
    tolerance: Mapping[str, float]
    members: Annotated[int, Interval(ge=1)]
    geometries: Annotated[tuple[Mapping[str, Any], ...], MinLen(1)]
    parameters: Annotated[tuple[Range, ...], MinLen(1)]
    outside: Outside


@dataclass(frozen=True)
class Draw:
    """One display of a family. geometry: which one; values: of its parameters."""

    index: int
    geometry: int
    is_outside: bool
    values: Mapping[str, float]


def names() -> list[str]:
    """The families that ship."""
    return sorted(path.stem for path in FOLDER.glob("*.yaml"))


@cache
def load_family(name: str) -> Family:
    """A family by its name. UserError: there is none."""
    if name not in names():
        raise UserError(f"no family of the name '{name}'; {suggest(name, names())}")
    return typed(load(FOLDER / f"{name}.yaml"), Family)


def drawn(family: Family, index: int) -> Draw:
    """A draw by its number, the same for the same family."""
    random = generator("family", family.base, family.seed, index)

    def share() -> float:
        return float(torch.rand((), generator=random, dtype=torch.float64))

    def value(given: Range) -> float:
        return float(f"{given.low + (given.high - given.low) * share():.{DIGITS}g}")

    geometry, is_outside = int(share() * len(family.geometries)), share() < family.outside.share
    values = {given.name: value(given) for given in family.parameters}
    more = {given.name: value(given) for given in family.outside.parameters}
    return Draw(index, geometry, is_outside, values | (more if is_outside else {}))


def profile_of(family: Family, draw: Draw, name: str) -> Profile:
    """The display of a draw, under a name; its patterns are its own."""
    own = seed("patterns of a draw", family.seed, draw.index) % 10**6
    base = replace(load_profile(family.base), name=name, version=1, seed=own)
    return with_values(base, {**family.geometries[draw.geometry], **draw.values})


def figures_of(family: Family, profile: Profile, kept: Holograms) -> dict[str, float]:
    """Means over the images of what is scored of captures, ``method.metric_domain``. CellError: no registration."""
    bench = open_bench(profile, family.panel, family.seed)
    found = dict[str, float]()
    for method in family.figures:
        scores = [
            score(bench.photograph(kept[method][item], target, item, 0).image, target, metrics=METRICS)
            for item, target in kept[TARGETS].items()
        ]
        for name in (f"{metric}_{domain}" for metric in METRICS for domain in DOMAINS):
            found[f"{method}.{name}"] = fmean(each[name] for each in scores)
    return found


def missed(family: Family, row: Row, domain: str, metrics: Collection[str] = METRICS) -> float:
    """The largest miss of a figure by a draw, in tolerances; infinite for a display that could not be registered."""
    misses = [
        abs(row[f"{method}.{metric}_{domain}"] - figure) / family.tolerance[metric]
        for method, figures in family.figures.items()
        for metric, figure in figures.items()
        if metric in metrics
    ]
    return math.inf if any(map(math.isnan, misses)) else max(misses)


def compute(name: str, folder: Path, executor: Executor, draws: int, tell: Callable[[int, int], object]) -> list[Row]:
    """All rows of a family's first draws; those that the folder has are kept.

    A row has ``draw``, ``geometry``, ``outside``, every parameter, and ``figures_of``, NaN where the display cannot be
    registered. tell: called after each draw with how many are done, and of how many. UserError: the folder's draws
    are of another family, or damaged.
    """
    family, path = load_family(name), folder / "draws.csv"
    columns, work = columns_of(family), partial(_evaluated, name, folder)
    with locked(folder / ".lock"):  # another run here waits, and then has the rows
        _refuse_others(name, family, folder)
        for number in range(len(family.geometries)):
            _solve(family, number, folder)
        content = path.read_bytes() if path.is_file() else (",".join(columns) + "\n").encode()
        write_atomically(path, content[: content.rfind(b"\n") + 1])  # without a line that was cut short
        known = {row["draw"] for row in rows_of(path, columns)}
        left = [index for index in range(draws) if index not in known]
        for count, (_, result) in enumerate(executor.map(work, iter(left)), 1):
            if isinstance(result, Exception):
                raise result
            with path.open("a", encoding="utf-8", newline="") as file:
                csv.DictWriter(file, columns, lineterminator="\n").writerow(result)
            tell(count, len(left))
        return [row for row in rows_of(path, columns) if row["draw"] < draws]


def rows_of(path: Path, columns: Sequence[str]) -> list[Row]:
    """The rows of a file of draws, in the order of their numbers. UserError: it is damaged."""
    with path.open(encoding="utf-8", newline="") as file:
        header, *lines = list(csv.reader(file)) or [[]]
    if header != list(columns):
        raise UserError(f"{path}: its first line does not name the columns of the draws; delete the file")
    found = dict[float, Row]()
    for number, line in enumerate(lines, 2):
        try:
            row = dict(zip(columns, (float(value or "nan") for value in line), strict=True))
        except ValueError:
            raise UserError(f"{path}:{number}: damaged; delete the line, and it is drawn again") from None
        found[row["draw"]] = row
    return [found[draw] for draw in sorted(found)]


def _refuse_others(name: str, family: Family, folder: Path) -> None:
    """UserError for a folder whose draws are of other ranges, or of other code."""
    path, dataset = folder / "family.json", family.targets.dataset
    own = {
        "family": hashlib.sha256((FOLDER / f"{name}.yaml").read_bytes()).hexdigest(),
        "base": load_profile(family.base).digest,
        "code": HARNESS,
        dataset: dataset_version(dataset, plugins.find("datasets", dataset)),
        **{method: method_version(plugins.find("methods", method)) for method in family.figures},
    }
    known = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
    if known != own and (known is not None or (folder / "draws.csv").is_file()):
        raise UserError(f"{folder}: has draws of another family, or by other code; choose another --output")
    write_atomically(path, json.dumps(own, indent=1).encode())


def columns_of(family: Family) -> list[str]:
    """The columns of a file of draws."""
    scores = [f"{method}.{metric}_{domain}" for method in family.figures for metric in METRICS for domain in DOMAINS]
    parameters = [given.name for given in (*family.parameters, *family.outside.parameters)]
    return ["draw", "geometry", "outside", *parameters, *scores]


def _evaluated(name: str, folder: Path, index: int) -> dict[str, Any]:
    torch.set_num_threads(1)
    family = load_family(name)
    draw = drawn(family, index)
    row: dict[str, Any] = {"draw": index, "geometry": draw.geometry, "outside": int(draw.is_outside), **draw.values}
    with suppress(CellError):  # a display whose camera cannot be registered has empty scores: it misses every figure
        profile = profile_of(family, draw, f"{name} draw {index}")
        found = figures_of(family, profile, solved(folder, draw.geometry))
        row |= {key: f"{value:.5g}" for key, value in found.items()}
    return row


def _solve(family: Family, number: int, folder: Path) -> None:
    """Keep the targets and the holograms of a geometry, which depend on nothing that is drawn."""
    path = folder / f"holograms-{number}.pt"
    if path.is_file():
        return
    nominal = profile_of(family, Draw(0, number, False, {}), family.base)
    bench = open_bench(nominal, family.panel, family.seed)
    dataset = plugins.build("datasets", family.targets.dataset, dict(family.targets.params))
    targets = {item: dataset.load(item, bench.spec.region.shape) for item in dataset.items()}
    kept = {TARGETS: targets}
    for name in family.figures:
        kept[name] = {item: hologram(name, bench, target, item) for item, target in targets.items()}
    write_atomically(path, packed(kept))


@cache
def solved(folder: Path, geometry: int) -> Holograms:
    """The targets and the holograms of a geometry."""
    found: Holograms = torch.load(folder / f"holograms-{geometry}.pt", weights_only=True)
    return found
