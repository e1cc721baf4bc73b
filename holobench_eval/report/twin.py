"""The report of a twin: how far it can stand for its display."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ..core.io import write_atomically
from ..display.estimates import QUANTITIES
from ..display.simulated.trust import MOST
from ..metrics import match
from ..study.calibration.twin import Photographed
from .charts.look.methods import looks
from .charts.twin import draw_twin_pictures, draw_twin_scores
from .data.statistics import Estimate
from .data.twin import Trial
from .markdown import Markdown, blocks, bullets, code, heading, table_of
from .sections.diagnosis import quantities

COLOURS = ("red", "green", "blue")
PICTURES, SCORES = "pictures.jpg", "scores.png"


def write_twin(folder: Path, photographed: Photographed, trial: Photographed, found: Trial, profile: Path) -> Path:
    """Write ``report.md`` and its pictures; returns the path of the former."""
    _draw(folder, photographed, trial, found)
    path, less = folder / "report.md", len(found.twins) > 1
    text = blocks(
        [
            heading(f"{found.name}: {'the twin of' if less else 'a network in the place of'} {found.of}", 1),
            bullets(answer(found)),
            Markdown("![A picture on the display and on its twin]({})").format(Markdown(PICTURES)),
            "The first picture, matched to its target; differences in linear light, without their sign.",
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
    yield (
        f"A capture of the twin is further from a photograph than a second photograph is by {min(gaps.values()):.1f} "
        f"to {max(gaps.values()):.1f} dB, by method."
    )
    sentence = f"Flattery: holograms made through the twin score {_signed(flattery)} dB more on it than on the display."
    if flattery.mean > MOST:
        sentence += f" That is more than {MOST:g} dB: it does not tell which method that learns is better."
        sentence += f" {len(found.pictures)} pictures do not tell it from less; try more." * (flattery.low < MOST)
    yield sentence
    plain, learned = found.worst(), found.worst(learned=True)
    yield (
        f"Differences of two methods are off by up to {plain.apart:.1f} dB where neither learns, and by up to "
        f"{learned.apart:.1f} dB where one has learned the display."
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


def _parameters(photographed: Photographed, in_halves: bool) -> Iterable[Markdown | str]:
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
        rows[label] = shown.numpy(), match(second, shown)[0].numpy(), match(twin, shown)[0].numpy()
    draw_twin_pictures(folder / PICTURES, rows)
    names = {entry.label: entry.name for entry in photographed.study.methods}
    own, *others = ({label: each.scores for label, each in shown.items()} for shown in found.twins.values())
    draw_twin_scores(folder / SCORES, found.display, own, looks(names), others)
