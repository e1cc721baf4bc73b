"""The report of a twin: how it compares with its display, and how far it can stand for it.

The same holograms are photographed on one and captured on the other. Besides noise, captures are off in their light and
out of place.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from scipy.optimize import nnls
from scipy.stats import kendalltau
from torch import Tensor

from ..core.device import CPU
from ..core.io import write_atomically
from ..display import Profile
from ..display.estimates import QUANTITIES
from ..display.simulated.trust import MOST, Trust
from ..metrics import match, score
from ..study.artifacts import TrainingRecord
from ..study.twin import SCORE, Photographed, captured, opened
from .charts.look import looks
from .charts.twin import draw_twin_pictures, draw_twin_scores
from .markdown import Markdown, blocks, bullets, code, heading, table_of
from .statistics import Array, Estimate, mean_interval
from .stories.training import Training, estimates
from .text import grouped

COLOURS = ("red", "green", "blue")
PICTURES, SCORES = "pictures.jpg", "scores.png"
DARKEST = 1e-9  # mean square that no difference falls below, where a display has no noise
AREA = (-2, -1)


def noise_of(pairs: Sequence[Sequence[Tensor]]) -> Tensor:
    """Variance of a photograph, ``a + b I + c I^2`` of its light I: read noise, shot noise and flicker; ``(C, 3)``.

    pairs: of photographs ``(C, h, w)`` of one hologram each, in equal brightness; by least squares over all pixels.
    """
    firsts, seconds = (torch.stack(each).double() for each in zip(*pairs, strict=True))
    seconds = seconds * ((firsts * seconds).sum(AREA, True) / seconds.square().sum(AREA, True).clamp_min(DARKEST))
    both = (firsts + seconds) / 2, (firsts - seconds).square() / 2
    light, squares = (each.transpose(0, 1).flatten(1) for each in both)
    powers = torch.stack([light**power for power in range(3)], -1)
    return torch.linalg.lstsq(powers, squares[..., None]).solution[..., 0]


def compared(photograph: Tensor, capture: Tensor, target: Tensor, noise: Tensor) -> dict[str, Array]:
    """A hologram on both, mean squares ``(C,)``: of the difference of capture and photograph, the latter matched to the
    target and the former to it; of that of two photographs; of the light of the capture; of its slope over a pixel."""
    factors = match(photograph, target)[1]
    first = photograph * factors[:, None, None]  # not clipped, as noise is not
    other = capture * match(capture, first)[1][:, None, None]
    light = (capture * match(capture, target)[1][:, None, None]).double()
    powers = torch.stack([photograph.double().pow(power).mean(AREA) for power in range(3)], -1)
    squares = {
        "apart": (other - first).double().square().mean(AREA).clamp_min(DARKEST),
        "noise": (2 * (noise * powers).sum(1).clamp_min(0) * factors.double().square()).clamp_min(DARKEST),
        "light": light.square().mean(AREA),
        "slope": light.diff(dim=-2).square().mean(AREA) + light.diff(dim=-1).square().mean(AREA),
    }
    return {name: each.numpy() for name, each in squares.items()}


def further(shot: dict[str, Array]) -> tuple[Array, Array]:
    """PSNR of a capture against a photograph, and how much lower that is than a second photograph's would be, each
    ``(1 + C,)`` [dB] with all colours first."""
    likeness, bound = (-10 * np.log10([shot[key].mean(), *shot[key]]) for key in ("apart", "noise"))
    return likeness, bound - likeness


def misfit(shots: Sequence[dict[str, Array]]) -> tuple[Array, Array]:
    """What a twin is off by besides noise, by colour: the share of the light ``(C,)``, and its place along each axis
    ``(C,)`` [px of the target], both rms and independent from pixel to pixel.

    Together they tell how much further a capture is; one stands for the other where all pictures have details of one
    size. By least squares over holograms, none below zero; what is left of each counts by its noise.
    """
    left, *contents = (np.array([shot[key] / shot["noise"] for shot in shots]).T for key in ("apart", "light", "slope"))
    squares = [nnls(each, own - 1)[0] for each, own in zip(np.stack(contents, -1), left, strict=True)]
    light, place = np.sqrt(squares).T
    return light, place


@dataclass(frozen=True)
class Trial:
    """A twin that was tried.

    label: of the method whose holograms were made through it; frame: a row a picture, columns ``(value, display,
    method)``; the value ``score`` is of the display and of each of the trial, the twin first; ``likeness`` is that of a
    capture there to a photograph, ``further`` how much higher that of a second photograph is, and then by colour [dB].
    first: captures of the twin of the first picture, by method; off: light and place of ``misfit``, none of a network,
    which has no noise; is_simulated: whether the display is.
    """

    name: str
    of: str
    label: str
    photographs: int
    frame: pd.DataFrame
    first: Mapping[str, Tensor]
    off: tuple[Array, ...] = ()
    is_simulated: bool = True

    @cached_property
    def means(self) -> pd.DataFrame:
        """Over pictures: a row a method, columns ``(value, display)``, in the order of the study and of the trial."""
        means: pd.DataFrame = self.frame.mean().unstack([0, 1], sort=False)
        return means

    @property
    def twins(self) -> list[str]:
        """The displays of the trial: the twin, and those that know less."""
        return list(self.means["further"])

    def less(self, first: tuple[str, str], second: tuple[str, str]) -> Estimate:
        """Score on a display by a method, less that of another."""
        return mean_interval((self.frame["score"][first] - self.frame["score"][second]).to_numpy())

    def difference(self, method: str) -> Estimate:
        """Score on the twin less score on the display; of the twin's own holograms: its flattery."""
        return self.less((self.name, method), (self.of, method))

    def pairs(self, twin: str = "") -> list[dict[str, Any]]:
        """Every pair of methods: its difference on the display and on one of the trial, and how far these are apart;
        the furthest first."""
        rows = []
        for pair in itertools.combinations(self.means.index, 2):
            own, other = (self.less(*((name, each) for each in pair)) for name in (self.of, twin or self.name))
            rows.append({"methods": pair, "display": own, "twin": other, "apart": abs(other.mean - own.mean)})
        return sorted(rows, key=lambda row: -row["apart"])

    def worst(self, twin: str = "", learned: bool = False) -> float:
        """How far a display of the trial is off in two methods without a camera; or with one that has [dB]."""
        return next(row["apart"] for row in self.pairs(twin) if (self.label in row["methods"]) == learned)

    def tau(self, twin: str = "") -> float:
        """Kendall's tau between the orders of methods by their means."""
        means = self.means["score"]
        return float(kendalltau(means[self.of], means[twin or self.name]).statistic)

    def trust(self) -> Trust:
        """What stands in the profile."""
        flattery, gaps = self.difference(self.label), self.means["further", self.name]
        known = {str(label): round(float(gap), 2) for label, gap in gaps.items()}
        light, place = (tuple(round(float(each), 4) for each in own) for own in self.off or ((), ()))
        mean, error = (round(value, 2) for value in (flattery.mean, (flattery.high - flattery.low) / 2))
        return Trust(self.of, self.photographs, len(self.frame), known, light, place, mean, error)


def tried(photographed: Photographed, displays: Sequence[Profile], device: torch.device = CPU) -> Trial:
    """Show the holograms of a display on those of a trial, the twin first, and compare. UserError: a photograph is
    missing, or a display cannot be registered.

    Of a method whose repeats have random starts the first is shown.
    """
    of, twice, own = photographed.display, photographed.twice, photographed.row.label
    items = dict.fromkeys(item for _, item in photographed.own)
    noise = {item: noise_of([photographed.pair(*key) for key in twice if key[1] == item]) for item in items}
    values: dict[str, dict[tuple[str, str, str], float]] = {item: {} for item in items}
    shots, first = list[dict[str, Array]](), dict[str, Tensor]()
    for (label, item), cells in photographed.own.items():
        scores = [photographed.captures(cell)[1] for cell in cells[: None if (label, item) in twice else 1]]
        values[item]["score", of.name, label] = float(np.mean(scores))
    for profile in displays:
        bench = opened(photographed, profile, device)
        for (label, item), cells in photographed.own.items():
            target, photograph = photographed.target(item), photographed.captures(cells[0])[0]
            capture = captured(photographed, bench, label, item)
            shot = compared(photograph, capture, target, noise[item])
            likeness, gaps = further(shot)
            if profile is displays[0]:
                shots.append(shot)
                first.setdefault(label, capture)
            keys = ("score", "likeness", "further", *COLOURS * (len(gaps) > len(COLOURS)))
            shown = score(capture, target, metrics=("psnr",))[SCORE], likeness[0], *gaps
            values[item] |= {(key, profile.name, label): each for key, each in zip(keys, shown, strict=False)}
    frame = pd.DataFrame.from_dict(values, orient="index")
    off = misfit(shots) if photographed.row.name == "twin" else ()
    learned, is_simulated = photographed.learned.provenance["captures"], of.real is None
    return Trial(displays[0].name, of.name, own, learned, frame, first, off, is_simulated)


def answer(found: Trial) -> Iterator[str]:
    """What a lab has to know before it uses the twin."""
    flattery = found.difference(found.label)
    (nearest, least), *_, (furthest, most) = found.means["further", found.name].sort_values().items()
    yield (
        f"A capture of the twin is further from a photograph than a second photograph is by {least:.1f} dB ({nearest}) "
        f"to {most:.1f} dB ({furthest})."
    )
    if found.off:
        light, place = map(max, found.off)
        off = f"{light:.1%} of the light and {place:.2f} pixels out of place would make, both rms."
        yield f"Besides noise it is off by as much as {off}"
    sentence = f"Flattery: holograms made through the twin score {_signed(flattery)} dB more on it than on the display."
    if flattery.mean > MOST:
        sentence += f" That is more than {MOST:g} dB: it does not tell which method that learns is better."
        sentence += f" {len(found.frame)} pictures do not tell it from less; try more." * (flattery.low < MOST)
    yield sentence
    yield (
        f"A difference of two methods below {found.worst():.1f} dB tells nothing of the display, nor one below "
        f"{found.worst(learned=True):.1f} dB where a method has learned the display: the twin is off by as much."
    )
    if len(found.twins) == 1:
        yield "A network has no noise, and the display has: that is a part of its flattery and of its distance."
    if found.is_simulated:
        yield "The display is simulated, by equations that are in part the twin's: expect larger errors on a bench."


def _signed(estimate: Estimate) -> str:
    return f"{estimate.mean:+.2f} [{estimate.low:.2f}, {estimate.high:.2f}]"


def write_twin(folder: Path, photographed: Photographed, found: Trial, profile: Path) -> Path:
    """Write ``report.md`` and its pictures; returns the path of the former."""
    _draw(folder, photographed, found)
    known = Training("", (), found.of, TrainingRecord(photographed.learned.provenance, ()))
    has_equations, learned = len(found.twins) > 1, list(estimates(known))
    means, of, twin = found.means.sort_values(("score", found.of), ascending=False), found.of, found.name
    methods = [
        {
            "method": f"{label}{' (flattery)' * (label == found.label)}",
            "display [dB]": f"{own['score', of]:.2f}",
            "twin [dB]": f"{own['score', twin]:.2f}",
            "twin less display [dB]": _signed(found.difference(label)),
            "against a photograph [dB]": f"{own['likeness', twin]:.1f}",
            "further [dB]": f"{own['further', twin]:.2f}",
            **{colour: f"{own[colour, twin]:.2f}" for colour in COLOURS if (colour, twin) in own},
        }
        for label, own in zip(map(str, means.index), means.to_dict("records"), strict=True)
    ]
    pairs = [
        {
            "methods": " less ".join(row["methods"]),
            "display [dB]": _signed(row["display"]),
            "twin [dB]": _signed(row["twin"]),
            "apart [dB]": f"{row['apart']:.2f}",
        }
        for row in found.pairs()
    ]
    others = [
        {
            "display": name,
            "further, mean [dB]": f"{means['further', name].mean():.1f}",
            "Kendall's tau": f"{found.tau(name):.2f}",
            "two without a camera, off by [dB]": f"{found.worst(name):.1f}",
        }
        for name in found.twins
    ]
    hidden = dict.fromkeys(QUANTITIES[row["name"]].words for row in learned if row.get("seen") is False)
    alike = "have the equations of the bench fit a twin" if has_equations else "resemble the network fit it"
    what = "the twin of" if has_equations else "a network in the place of"
    text = [
        heading(f"{found.name}: {what} {found.of}", 1),
        bullets(answer(found)),
        Markdown("![A picture on the display and on its twin]({})").format(Markdown(PICTURES)),
        "The first picture, matched to its target; of a large one its most detailed part. Differences to the "
        "photograph in linear light, without their sign.",
        heading("The same holograms on both"),
        table_of(methods),
        f"PSNR in linear light, means over {len(found.frame)} pictures that the twin did not learn from, with "
        "95 % intervals. Against a photograph: of a capture of the twin. Further: how much higher that of a second "
        "photograph is, which differs by noise alone; of all colours, and of each.",
        Markdown("![Scores on display and twin]({})").format(Markdown(SCORES)),
        has_equations and "Pale: the twin with its maps turned by half a turn (x), and without maps (+).",
        heading("Differences of two methods"),
        table_of(pairs),
        has_equations and heading("Beside twins that know less"),
        has_equations and table_of(others),
        has_equations
        and f"Only what the first row has and the others lack is knowledge of {found.of}: a column in which the second "
        "is as good tells nothing.",
        learned and heading("What it says of the display"),
        quantities(learned),
        learned
        and has_equations
        and "Stated errors are meant to hold with 90 %: how far fits to halves of the photographs, of different "
        "holograms, move apart, and no less than what was left on simulated displays. In brackets the truth, where the "
        "display is simulated.",
        has_equations and hidden and f"No photograph shows: {', '.join(hidden)}.",
        heading("How to use it"),
        bullets(
            [
                Markdown("In a config: {}; with every command that takes a display: {}.").format(
                    code(f"display: {{profiles: [{profile.name}]}}"), code(f"--display {profile.name}")
                ),
                f"It has learned {found.of} from {found.photographs} photographs, on this panel: a smaller one is "
                "refused, a larger one becomes this. What drifts or flickers on the display does not do so here.",
                f"Methods that {alike} better than the display: expect less there.",
            ]
        ),
    ]
    path = folder / "report.md"
    write_atomically(path, f"{blocks(text)}\n".encode())
    return path


def _draw(folder: Path, photographed: Photographed, found: Trial) -> None:
    item, rows = found.frame.index[0], {}
    target = photographed.target(item)
    for label in dict.fromkeys([photographed.study.baseline, found.label]):
        if (label, item) in photographed.twice:
            first, second = photographed.pair(label, item)
            first = match(first, target)[0]
            rows[label] = first, match(second, first)[0], match(found.first[label], first)[0]
    draw_twin_pictures(folder / PICTURES, f"{found.of} and {found.name}", (item, target), rows)
    names = {entry.label: entry.name for entry in photographed.study.methods}
    scores = found.frame["score"]
    display, twin, *others = ({key: scores[name, key] for key in scores[name]} for name in (found.of, *found.twins))
    draw_twin_scores(folder / SCORES, display, twin, looks(names), others)


def quantities(rows: Sequence[Mapping[str, Any]]) -> Markdown | None:
    """A row for every quantity, a column for every colour: the estimate and, in brackets, the truth; of what no capture
    shows, neither."""
    colours: list[int | None] = sorted({row["colour"] for row in rows if row["colour"] is not None})
    if colours == [0]:  # of the only laser
        rows, colours = [{**row, "colour": None} for row in rows], []
    if any(row["colour"] is None for row in rows):
        colours.append(None)
    has_truth, lines = any(not math.isnan(row["truth"]) for row in rows), []
    for name, same in grouped((row["name"], row) for row in rows).items():
        first, cells, off = same[0], dict.fromkeys(colours, ""), [-1.0]
        for row in same:
            truth = "–" if math.isnan(row["truth"]) else f"{row['truth']:.3f}"
            seen = row.get("seen") is not False
            cells[row["colour"]] = f"{row['value']:.3f}{f' ({truth})' * has_truth}" if seen else "–"
            off += [row["apart"]] * (seen and not math.isnan(row["apart"]))
        line = {"quantity": QUANTITIES[name].words if name in QUANTITIES else name.replace("_", " ")}
        line |= {"unit": first["unit"] or ""}
        line |= {_colour(colour): cell for colour, cell in cells.items()}
        line["largest difference"] = f"{max(off):.3f}" if off[1:] else "–"
        stated = "–" if math.isnan(first["error"]) else f"{first['error']:.2g}"
        lines.append(line | {"stated error": "not seen" if first.get("seen") is False else stated})
    return table_of(lines)


def _colour(colour: int | None) -> str:
    return "all" if colour is None else dict(enumerate(COLOURS)).get(colour, f"colour {colour}")
