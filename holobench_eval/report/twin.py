"""The report of a twin: how it compares with its display, and how far it can stand for it.

The same holograms are photographed on one and captured on the other.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.stats import kendalltau

from ..core.io import write_atomically
from ..display.estimates import QUANTITIES
from ..display.simulated.trust import MOST, Trust
from ..metrics import match
from ..study.twin import Photographed, trial_names
from ..study.plan import Cell
from .charts.look.methods import looks
from .charts.twin import draw_twin_pictures, draw_twin_scores
from .distance import Compared, Misfit, Noise, further
from .markdown import Markdown, blocks, bullets, code, heading, table_of
from .statistics import Estimate, mean_interval
from .stories.training import quantities

COLOURS = ("red", "green", "blue")
PICTURES, SCORES = "pictures.jpg", "scores.png"


@dataclass(frozen=True)
class Shown:
    """Holograms of a method on one display: scores ``(pictures,)`` [dB]; and, ``(pictures, 1 + colours)`` with all
    colours first, PSNR of captures there against a photograph, and how much lower that is than that of a second
    photograph [dB]."""

    scores: NDArray[np.float64]
    likeness: NDArray[np.float64]
    gaps: NDArray[np.float64]


@dataclass(frozen=True)
class Pair:
    """Score of one method less that of another on the display and on its twin, means over pictures [dB]."""

    first: str
    second: str
    display: Estimate
    twin: Estimate

    @property
    def apart(self) -> float:
        """How far the twin is off."""
        return abs(self.twin.mean - self.display.mean)


@dataclass(frozen=True)
class Trial:
    """A twin that was tried.

    label: of the method whose holograms were made through it; pictures: by name; display: scores on the display
    ``(pictures,)`` by method; twins: by display of the trial and by method; the first is the twin. misfit: of a twin;
    is_simulated: whether the display is.
    """

    name: str
    of: str
    label: str
    photographs: int
    pictures: tuple[str, ...]
    display: Mapping[str, NDArray[np.float64]]
    twins: Mapping[str, Mapping[str, Shown]]
    misfit: Misfit | None
    is_simulated: bool = True

    @property
    def twin(self) -> Mapping[str, Shown]:
        """The twin, by method."""
        return self.twins[self.name]

    def difference(self, label: str) -> Estimate:
        """Score on the twin less score on the display; of the twin's own holograms: its flattery."""
        return mean_interval(self.twin[label].scores - self.display[label])

    def pairs(self, name: str = "") -> list[Pair]:
        """Every pair of methods, on the display and on one of the trial."""
        shown = self.twins[name or self.name]
        return [
            Pair(
                first,
                second,
                mean_interval(self.display[first] - self.display[second]),
                mean_interval(shown[first].scores - shown[second].scores),
            )
            for first, second in itertools.combinations(self.display, 2)
        ]

    def worst(self, name: str = "", learned: bool = False) -> Pair:
        """The pair that a display of the trial has furthest off, of methods without a camera; or with one that has."""
        return max(
            (pair for pair in self.pairs(name) if (self.label in (pair.first, pair.second)) == learned),
            key=lambda pair: pair.apart,
        )

    def tau(self, name: str = "") -> float:
        """Kendall's tau between the orders of methods by their means."""
        shown = self.twins[name or self.name]
        means = [(scores.mean(), shown[label].scores.mean()) for label, scores in self.display.items()]
        return float(kendalltau(*zip(*means, strict=True)).statistic)

    def trust(self) -> Trust:
        """What stands in the profile."""
        flattery = self.difference(self.label)
        gap = {label: round(float(shown.gaps[:, 0].mean()), 2) for label, shown in self.twin.items()}
        error = round((flattery.high - flattery.low) / 2, 2)
        off = (self.misfit.light, self.misfit.place) if self.misfit else ((), ())
        light, place = (tuple(round(float(each), 4) for each in own) for own in off)
        return Trust(self.of, self.photographs, len(self.pictures), gap, light, place, round(flattery.mean, 2), error)


def tried(photographed: Photographed, trial: Photographed, name: str) -> Trial:
    """Compare the photographs of a display with the captures of its twin. UserError: a cell of either is missing."""
    pictures = tuple(dict.fromkeys(item for _, item in photographed.own))
    labels = tuple(dict.fromkeys(label for label, _ in photographed.own))
    targets = {item: photographed.target(item) for item in pictures}
    display: dict[str, NDArray[np.float64]] = {}
    twins: dict[str, dict[str, Shown]] = {each: {} for each in trial_names(name, photographed)}
    on_twins, compared = trial.cells(), list[Compared]()
    noise = {
        item: Noise.of([photographed.pair(*key) for key in photographed.twice if key[1] == item]) for item in pictures
    }
    for label in labels:
        own = {item: [photographed.captures(cell) for cell in same(photographed, label, item)] for item in pictures}
        display[label] = np.array([np.mean([score for _, score in shots]) for shots in own.values()])
        for each, shown in twins.items():
            others = {item: trial.captures(on_twins[each][label, item][0]) for item in pictures}
            shots = [Compared(own[item][0][0], others[item][0], targets[item], noise[item]) for item in pictures]
            likeness, gaps = zip(*(further(shot) for shot in shots), strict=True)
            compared += shots * (each == name)
            scores = np.array([score for _, score in others.values()])
            shown[label] = Shown(scores, torch.stack(likeness).numpy(), torch.stack(gaps).numpy())
    learned = photographed.learned.provenance["captures"]
    misfit = Misfit.of(compared) if photographed.row.name == "twin" else None  # a network has no noise
    of, is_simulated = photographed.display.name, photographed.display.real is None
    return Trial(name, of, photographed.label, learned, pictures, display, twins, misfit, is_simulated)


def same(photographed: Photographed, label: str, item: str) -> list[Cell]:
    """The photographs of the hologram that is shown on the twin: all repeats, or the first of a method whose repeats
    have random starts."""
    return photographed.own[label, item][: None if (label, item) in photographed.twice else 1]


def write_twin(folder: Path, photographed: Photographed, trial: Photographed, found: Trial, profile: Path) -> Path:
    """Write ``report.md`` and its pictures; returns the path of the former."""
    _draw(folder, photographed, trial, found)
    path, less = folder / "report.md", len(found.twins) > 1
    text = blocks(
        [
            heading(f"{found.name}: {'the twin of' if less else 'a network in the place of'} {found.of}", 1),
            bullets(answer(found)),
            Markdown("![A picture on the display and on its twin]({})").format(Markdown(PICTURES)),
            "The first picture, matched to its target; of a large one its most detailed part. Differences to the "
            "photograph in linear light, without their sign.",
            heading("The same holograms on both"),
            _methods(found),
            f"PSNR in linear light, means over {len(found.pictures)} pictures that the twin did not learn from, with "
            "95 % intervals. Against a photograph: of a capture of the twin. Further: how much higher that of a second "
            "photograph is, which differs by noise alone; of all colours, and of each.",
            Markdown("![Scores on display and twin]({})").format(Markdown(SCORES)),
            *(["Pale: the twin with its maps turned by half a turn (x), and without maps (+)."] if less else []),
            heading("Differences of two methods"),
            _pairs(found),
            *(_others(found) if less else []),
            *_parameters(photographed, less),
            heading("How to use it"),
            bullets(_use(found, profile, less)),
        ]
    )
    write_atomically(path, f"{text}\n".encode())
    return path


def answer(found: Trial) -> Iterable[str]:
    """What a lab has to know before it uses the twin."""
    gaps = {label: float(shown.gaps[:, 0].mean()) for label, shown in found.twin.items()}
    flattery = found.difference(found.label)
    (least, nearest), *_, (most, furthest) = sorted((gap, label) for label, gap in gaps.items())
    yield (
        f"A capture of the twin is further from a photograph than a second photograph is by {least:.1f} dB ({nearest}) "
        f"to {most:.1f} dB ({furthest})."
    )
    if found.misfit:
        yield (
            f"Besides noise it is off by as much as {max(found.misfit.light):.1%} of the light and "
            f"{max(found.misfit.place):.2f} pixels out of place would make, both rms."
        )
    sentence = f"Flattery: holograms made through the twin score {_signed(flattery)} dB more on it than on the display."
    if flattery.mean > MOST:
        sentence += f" That is more than {MOST:g} dB: it does not tell which method that learns is better."
        sentence += f" {len(found.pictures)} pictures do not tell it from less; try more." * (flattery.low < MOST)
    yield sentence
    plain, learned = found.worst(), found.worst(learned=True)
    yield (
        f"A difference of two methods below {plain.apart:.1f} dB tells nothing of the display, nor one below "
        f"{learned.apart:.1f} dB where a method has learned the display: the twin is off by as much."
    )
    if len(found.twins) == 1:
        yield "A network has no noise, and the display has: that is a part of its flattery and of its distance."
    if found.is_simulated:
        yield "The display is simulated, by equations that are in part the twin's: expect larger errors on a bench."


def _signed(estimate: Estimate) -> str:
    return f"{estimate.mean:+.2f} [{estimate.low:.2f}, {estimate.high:.2f}]"


def _methods(found: Trial) -> Markdown | None:
    lines = []
    for label, scores in sorted(found.display.items(), key=lambda item: -float(item[1].mean())):
        shown = found.twin[label]
        gap, *of_colours = (f"{gap:.2f}" for gap in shown.gaps.mean(0))
        line = {
            "method": f"{label} (flattery)" if label == found.label else label,
            "display [dB]": f"{scores.mean():.2f}",
            "twin [dB]": f"{shown.scores.mean():.2f}",
            "twin less display [dB]": _signed(found.difference(label)),
            "against a photograph [dB]": f"{shown.likeness[:, 0].mean():.1f}",
            "further [dB]": gap,
        }
        lines.append(line | (dict(zip(COLOURS, of_colours, strict=True)) if len(of_colours) == len(COLOURS) else {}))
    return table_of(lines)


def _pairs(found: Trial) -> Markdown | None:
    return table_of(
        [
            {
                "methods": f"{pair.first} less {pair.second}",
                "display [dB]": _signed(pair.display),
                "twin [dB]": _signed(pair.twin),
                "apart [dB]": f"{pair.apart:.2f}",
            }
            for pair in sorted(found.pairs(), key=lambda pair: -pair.apart)
        ]
    )


def _others(found: Trial) -> Iterable[Markdown | str | None]:
    yield heading("Beside twins that know less")
    yield table_of(
        [
            {
                "display": name,
                "further, mean [dB]": f"{np.mean([each.gaps[:, 0].mean() for each in shown.values()]):.1f}",
                "Kendall's tau": f"{found.tau(name):.2f}",
                "two without a camera, off by [dB]": f"{found.worst(name).apart:.1f}",
            }
            for name, shown in found.twins.items()
        ]
    )
    yield (
        f"Only what the first row has and the others lack is knowledge of {found.of}: a column in which the second is "
        "as good tells nothing."
    )


def _parameters(photographed: Photographed, in_halves: bool) -> Iterable[Markdown | str | None]:
    rows = photographed.learned.provenance.get("estimates") or []
    if not rows:
        return
    yield heading("What it says of the display")
    yield quantities(rows)
    if not in_halves:
        return
    hidden = [QUANTITIES[row["name"]].words for row in rows if row.get("seen") is False]
    yield (
        "Stated errors are meant to hold with 90 %: how far fits to halves of the photographs, of different holograms, "
        "move apart, and no less than what was left on simulated displays. In brackets the truth, where the display is "
        "simulated."
    )
    if hidden:
        yield f"No photograph shows: {', '.join(dict.fromkeys(hidden))}."


def _use(found: Trial, profile: Path, has_equations: bool) -> Iterable[str | Markdown]:
    yield Markdown("In a config: {}; with every command that takes a display: {}.").format(
        code(f"display: {{profiles: [{profile.name}]}}"), code(f"--display {profile.name}")
    )
    yield (
        f"It has learned {found.of} from {found.photographs} photographs, on this panel: a smaller one is refused, a "
        "larger one becomes this. What drifts or flickers on the display does not do so here."
    )
    alike = "have the equations of the bench fit a twin" if has_equations else "resemble the network fit it"
    yield f"Methods that {alike} better than the display: expect less there."


def _draw(folder: Path, photographed: Photographed, trial: Photographed, found: Trial) -> None:
    item, on_twins = found.pictures[0], trial.cells()
    target, rows = photographed.target(item), {}
    twice = [label for label, each in photographed.twice if each == item]
    for label in dict.fromkeys(label for label in (photographed.study.baseline, found.label) if label in twice):
        first, second = photographed.pair(label, item)
        twin = trial.captures(on_twins[found.name][label, item][0])[0]
        shown = match(first, target)[0]
        rows[label] = shown, match(second, shown)[0], match(twin, shown)[0]
    draw_twin_pictures(folder / PICTURES, f"{found.of} and {found.name}", (item, target), rows)
    names = {entry.label: entry.name for entry in photographed.study.methods}
    own, *others = ({label: each.scores for label, each in shown.items()} for shown in found.twins.values())
    draw_twin_scores(folder / SCORES, found.display, own, looks(names), others)
