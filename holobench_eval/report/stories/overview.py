"""What all reports have: the question and its answer, what the answer rests on, how far it goes, and what was measured.

report.md has the first page and the limits; details.md has the setup, the paired tests, the holes and the environment.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import UserError
from ...core.io import read_text
from ...study.plan import is_reference
from ..board import board
from ..charts.tiles import draw_rows
from ..facts import FLOOR
from ..markdown import REPORT, Markdown, beginning, bullets, code, code_block, heading, properties, table, table_of
from ..phrases import edited, remarks, uncovered
from ..results import DONE, MOST_BYTES, Results
from ..statistics import FEWEST, POWER, SIGNIFICANCE
from ..story import Blocks, Figures, Part, Report, is_many, subjects
from ..text import FILES, grouped, plain, words
from . import answer, comparison, stories, story_of
from .alignment import agreement
from .training import trainings

ORDER = 0
PICTURES = "answer-pictures.jpg"
MOST_TILES = 6  # in the row of pictures, beside the target
MOST_NAMED = 4  # displays of one basis
FIRST = 5  # limits that stand in report.md; the others are in details.md
TARGETS_NAMED = 8
WEIGHTS = "https://download.pytorch.org/models/alexnet-owt-7be5be79.pth"


def _title(report: Report, _: Figures) -> Blocks:
    return [
        heading(report.results.study.title, 1),
        beginning(report.results.study.question or story_of(report.results).QUESTION),
    ]


def _answer(report: Report, _: Figures) -> Blocks:
    return [heading("Answer"), bullets(answer(report.results))]


def _table(report: Report, _: Figures) -> Blocks:
    return [getattr(story_of(report.results), "table", comparison.table)(board(report.results))]


def _figures(report: Report) -> list[tuple[Path, str]]:
    """The figures of numbers of all stories, that of the study's own first, which alone stands in report.md."""
    own = story_of(report.results)
    drawn = dict.fromkeys([own, comparison, *stories()] if hasattr(own, "figures") else [comparison, *stories()])
    return [figure for story in drawn if hasattr(story, "figures") for figure in story.figures(report)]


def _pictures(report: Report) -> Iterator[tuple[Path, str]]:
    """A target, and its captures by the methods that are ``chosen``."""
    results, thumbnails, text = report.results, report.thumbnails, report.results.text
    for condition in [name for name in results.conditions if results.has_pictures(name)][:1]:
        labels = chosen(results, condition)
        for target in thumbnails.typical(labels, condition)[:1]:
            tiles = [(results.facts.marked(label), thumbnails.tile(label, condition, target)) for label in labels]
            typical = ", whose differences between methods are nearest to the mean" if len(results.targets) > 1 else ""
            which, path = f"{text.scored.capitalize()}s of {target}{typical}", report.figures / PICTURES
            draw_rows(path, condition, (target, thumbnails.targets(condition)[target]), [("", tiles)])
            yield path, f"{which}, on {condition}. {text.picture}. Left: the {text.truth}."


def _typical(report: Report) -> Iterable[tuple[Path, str]]:
    """The row of pictures, from the small copies where the records are not there; else that of an earlier report."""
    drawn = [] if report.drawn else list(_pictures(report))
    return drawn or report.pictures(PICTURES, lambda report: [])


def chosen(results: Results, condition: str) -> list[str]:
    """All methods where they are few; else the best of each group, those of the question, and the baseline."""
    display = next(each for each in board(results).displays if each.name == condition)
    firsts = [rows[0].label for _, rows in display.groups]
    wanted = {*firsts, *subjects(results), results.baseline}
    return [row.label for row in display.rows if len(display.rows) <= MOST_TILES or row.label in wanted]


def _stages(report: Report) -> Iterator[tuple[Path, str]]:
    """Pictures of the bench's stages, drawn before the report, where they are."""
    for name in dict.fromkeys(report.results.frame["display"]):
        path = report.figures / f"stages-{name}.png"
        if path.is_file():
            yield path, f"Stages of the simulated bench {name}."


def _parts(report: Report, _: Figures) -> Blocks:
    """The question of each part and the beginning of its answer, as its own report has them."""
    yield heading("Parts")
    run, lines = report.description.config_file or "CONFIG.yaml", list[Markdown]()
    for name in report.results.study.parts:
        try:
            title, question, headed, answer = read_text(report.output / name / REPORT, MOST_BYTES).split("\n\n", 4)[:4]
            if (title[:2], headed, answer[:2]) != ("# ", heading("Answer"), "- "):
                raise ValueError
            texts = (title[2:], question, answer[2:].partition("\n")[0])  # of a file: no HTML and no link of it counts
            told = (Markdown(text.replace("<", "&lt;").replace("](", "] (")) for text in texts)
            lines.append(Markdown("[{}]({}/{}). {} {}").format(next(told), name, REPORT, *told))
        except (UserError, OSError, ValueError) as error:
            how = "run" if isinstance(error, FileNotFoundError) else "report"
            command = f"holoeval {how} {run}/{name} --output {shlex.quote(str(report.output / name))}"
            lines.append(Markdown("{} has no report with an answer here: {} writes one.").format(name, code(command)))
    yield bullets(lines)


def _limits(report: Report, _: Figures) -> Blocks:
    known, first = limits(report), _first(report)
    more = Markdown("[{} more](details.md#limits)").format(len(known) - first)
    return [heading("Limits"), bullets([*known[:first], *[more] * (len(known) > first)])]


def _more_limits(report: Report, _: Figures) -> Blocks:
    yield heading("Limits")
    if report.results.study.would_change:
        yield Markdown("**What would change the answer.** {}").format(report.results.study.would_change)
    yield bullets(limits(report)[_first(report) :])


def _first(report: Report) -> int:
    """How many of the limits stand in report.md; the others are in details.md."""
    return min(FIRST, len(list(_bounds(report))))


def limits(report: Report) -> list[Markdown]:
    """How far the answer goes, what matters most first, and what settings and weights it rests on."""
    texts = [*_bounds(report), *_weights(report), *_tuned(report), *_lpips(report)]
    return [Markdown("**{}:** {}").format(*text.split(": ", 1)) for text in texts]


def _bounds(report: Report) -> Iterator[str]:
    """What is odd, the sample, the displays, who has the form of the bench, and what the study's own story adds."""
    study = report.results.study
    yield from (*remarks(report.results), *filter(None, [uncovered(report.records), edited(report.records)]))
    yield from (_sample(report), *_displays(report), *_form(report))
    yield from getattr(story_of(report.results), "LIMITS", ())
    published = f"{study.reported.source}." if study.reported else ""
    given = {"Measured": report.results.text.caution, "Published": published, "Note": study.note}
    yield from (f"{name}: {text}" for name, text in given.items() if text)


def _sample(report: Report) -> str:
    results, targets = report.results, len(report.results.targets)
    trained = " or trainings" * bool(report.once(trainings))
    size = f"{targets} target{'s' * (targets != 1)}{_among(results)}"
    parts = [f"{size}. Brackets: how a mean varies with other pictures of the kind, not with other displays{trained}."]
    if len(set(results.clusters)) < FEWEST:
        parts.append(f"Fewer than {FEWEST} clusters give no interval and no test.")
    if holes := int((results.holes["category"] != FLOOR).sum()):
        parts.append(f"{holes} planned cells have no score (details.md says why).")
    return f"Sample: {' '.join(parts)}"


def _among(results: Results) -> str:
    """In how many clusters the targets are, where these are fewer."""
    clusters = len(set(results.clusters))
    return f" in {clusters} cluster{'s' * (clusters > 1)}" if clusters < len(results.targets) else ""


def _displays(report: Report) -> Iterator[str]:
    same = grouped((each.basis or each.heading, each.name) for each in report.description.displays)
    known = [
        f"{words(names) if len(names) <= MOST_NAMED else f'{len(names)} displays'}: {basis.rstrip('.')}."
        for basis, names in same.items()
    ]
    if known:
        yield f"Displays: {' '.join(known)}"
    for label, model in report.description.models.items():
        yield f"{label}: descends through {model}."
    if report.results.study.measure == FILES:
        yield "Display: real, and known from its photographs alone."


def _form(report: Report) -> Iterator[str]:
    """Which methods fit a model that has the bench's own equations for some of its effects."""
    shares = grouped(
        (label, share)
        for display in report.description.displays
        for label, share in display.modelled.items()
        if share[0] and label in report.results.methods(display.name)
    )
    ends = {label: f"{'up to ' * (len({*each}) > 1)}{max(each)[0]} of {max(each)[1]}" for label, each in shares.items()}
    known = grouped((count, label) for label, count in ends.items())
    if parts := [f"{words(labels)} {count}" for count, labels in known.items()]:
        yield f"Inverse crime: effects of a display that models have in its equations: {'; '.join(parts)}. Expect less."


def _tuned(report: Report) -> Iterator[str]:
    tuned = report.results.facts.methods["tuned"].dropna()
    same = grouped((text, str(label)) for label, text in tuned.items())
    if parts := [f"of {words(labels)}, {text}" for text, labels in same.items()]:
        others = "The others have the settings of their papers, of this package or of the config."
        yield f"Tuned: {'; '.join(parts)}. {others}"


def _weights(report: Report) -> Iterator[str]:
    """Weights of others that the trained methods of the question take where a machine has them, and that it had not."""
    lacking = dict[tuple[tuple[str, ...], str], None]()
    for training in report.once(trainings):
        files = training.fact("description", dict, {}).get("external") or {}
        absent = tuple(name for name, digest in files.items() if digest == "absent")
        asked = [label for label in training.labels if absent and label in subjects(report.results)]
        lacking |= {(absent, label): None for label in asked}
    for absent, labels in grouped(lacking).items():
        yield f"Weights: without {words(list(absent))}, which this machine has not, learned {words(labels)}."


def _lpips(report: Report) -> Iterator[str]:
    """Why LPIPS is missing where it was wanted, and how to have it."""
    wanted, scored = report.results.study.protocol.metrics, " ".join(score.metric for score in report.results.scores)
    if (wanted is None or "lpips" in " ".join(wanted)) and "lpips" not in scored:
        yield (
            f"LPIPS: left out, since no package contains the weights of its trunk. Put {WEIGHTS} into the folder "
            "checkpoints of torch's hub cache and run again."
        )


def _reproduce(report: Report, _: Figures) -> Blocks:
    description = report.description
    yield heading("Reproduce")
    yield code_block(description.command or f"holoeval run {description.config_file or 'CONFIG.yaml'}")
    yield Markdown("{} [details.md](details.md): displays, methods, trainings, tests, config. {}").format(
        counts(report.results), "table.csv, records.csv: every mean and every cell."
    )


def counts(results: Results) -> str:
    """How large the study is, in one sentence."""
    cells = results.frame[results.frame["category"] != FLOOR]
    sizes = {"target": len(results.targets), "method": cells["label"].nunique(), "display": len(results.conditions)}
    size = ", ".join(f"{count} {noun}{'' if count == 1 else 's'}" for noun, count in sizes.items())
    lost = int((cells["state"] != DONE).sum())
    cell = "picture" if results.study.measure == FILES else "cell"
    return f"{size}: {len(cells)} {cell}s{f', {lost} without a score' if lost else ''}."


def _details(report: Report, _: Figures) -> Blocks:
    yield heading(Markdown("Details: {}").format(report.results.study.title), 1)
    yield Markdown("What [report.md](report.md) rests on, number by number.")


def _setup(report: Report, _: Figures) -> Blocks:
    """Everything that was the same for all methods, on displays or of pictures that were given."""
    study, results = report.results.study, report.results
    files, probe = study.measure == FILES, f"{study.holograms.name} ({plain(study.holograms.params)})"
    cells = [record["cell"] for record in report.records]
    panels = dict.fromkeys(
        " x ".join(map(str, cell["panel"])) + " pixels"
        for cell in cells
        if not files or (cell["panel"] and not is_reference(cell["condition"]))
    )
    images = ""
    if given := results.facts.training:
        limit = "no limit on captures" if given.captures is None else f"at most {given.captures} captures"
        images = f"{given.images} of {given.dataset}, of which {given.held_out} only watch the training; {limit}"
    distinct = {name: ", ".join(sorted({*results.frame[name]} - {""})) for name in ("exposure", "protocol")}
    more, names = len(results.targets) - TARGETS_NAMED, ", ".join(results.targets[:TARGETS_NAMED])
    rows = {
        "measured": study.predicts and f"predictions of the captures of holograms by {probe}",
        "targets": f"{len(results.targets)}{_among(results)}: {names}{f' and {more} more' if more > 0 else ''}",
        "size of the captures": files and "; ".join(panels).replace(" pixels;", ";"),
        "compared": files and results.text.compared,
        "dataset": not files
        and "; ".join(dict.fromkeys(f"{cell['dataset']} ({plain(cell['dataset_params'])})" for cell in cells)),
        "training images": bool(images) and not files and images,
        "panel": not files and "; ".join(panels),
        "exposure": not files and distinct["exposure"],
        "metric protocol": distinct["protocol"],
        "repeats": not files and results.frame["repeat"].nunique(),
        "seed": not files and str(study.seed),
        "headline metric": results.headline.axis,
        "baseline": results.baseline or "none",
        "registration": not files and _registration(results),
        "saturated samples of a capture": _saturation(results),
    }
    yield heading("What was measured")
    yield results.text.procedure
    yield properties((name, value) for name, value in rows.items() if value is not False)


def _registration(results: Results) -> str:
    """How far the geometry was off, display by display, and whether a second aligner agrees."""
    done = results.done
    if results.facts.network:
        return "none: the network predicts in the frame of the target"
    named = done["condition"].where(~done["condition"].isin(results.facts.changed), "displays after a change")
    residuals = [
        f"{condition} {' to '.join(dict.fromkeys(f'{end:.3f}' for end in (cells.min(), cells.max())))} px"
        for condition, cells in done.groupby(named, sort=False)["registration_residual_px"]
        if cells.notna().any()
    ]
    if is_many(results):
        ends = done["registration_residual_px"]
        residuals = [f"{len(results.conditions)} displays {ends.min():.3f} to {ends.max():.3f} px"]
    text = f"rms residual, in pixels of the scored region: {', '.join(residuals)}" if residuals else "not recorded"
    return f"{text}. {agreement(results)}" if results.study.display.real else text


def _saturation(results: Results) -> str:
    if results.facts.network:
        return "none: there is no sensor"
    most = float(results.done["saturated"].max())
    return f"at most {100 * most:.3g} %" if most >= 0 else "not recorded"


def _described(report: Report, _: Figures) -> Blocks:
    displays = report.description.displays
    yield heading("Displays and methods")
    yield report.results.text.displays if displays else "No description of the displays was recorded."
    for lines, same in grouped((display.lines, display) for display in displays).items():
        several = len(same) > 1
        yield heading(f"{len(same)} displays" if several else f"Display {same[0].name}", 3)
        yield bullets(f"{each.name}: {each.heading}" for each in same) if several else same[0].heading
        yield bullets(lines)
    yield heading("Methods", 3)
    cells, rows, known = {record["label"]: record["cell"] for record in report.records}, [], report.results.table
    firsts = dict[str, tuple[str, dict[str, object]]]()  # of each registered method
    for label in known.loc[known["category"] != FLOOR, "label"].unique():
        cell = cells[label]
        own = _flat(cell["params"])
        first, others = firsts.setdefault(cell["method"], (label, own))
        changed = {name: value for name, value in own.items() if label == first or value != others.get(name)}
        given = plain(changed).replace(" = ", "=")
        limit = f"; at most {cell['captures']} captures per target" if cell.get("captures") else ""
        rows.append([label, code(cell["method"]), f"{f'as {first}: ' * (label != first)}{given}{limit}"])
    yield table(["method", "registered as", "parameters"], rows)


def _flat(params: Mapping[str, object], before: str = "") -> dict[str, object]:
    """Parameters with those of parameters, their names joined by dots."""
    flat = dict[str, object]()
    for name, value in params.items():
        flat |= _flat(value, f"{before}{name}.") if isinstance(value, Mapping) else {f"{before}{name}": value}
    return flat


def _tests(report: Report, _: Figures) -> Blocks:
    """The paired tests against the baseline."""
    results, score, marked = report.results, report.results.headline, report.results.facts.marked
    tests = results.tests.values()
    yield heading("Paired tests")
    if not tests:
        yield "There are no comparisons with a baseline."
        return
    yield (
        f"Differences to the baseline {results.baseline}, target by target, repeats averaged first: {score.axis}"
        f"{results.text.axis}. Two-sided sign-flip min-p test (step-down) over clusters of targets; each p is adjusted "
        f"for all {sum(np.isfinite(test.p) for test in tests)} tests, intervals are not; shown: p < {SIGNIFICANCE}. "
        f'"Could show": what a test of this comparison alone shows with {100 * POWER:.0f} % power. tests.csv has all.'
    )
    rows = [
        {
            "method": marked(test.second),
            "display": test.condition,
            f"mean difference{score.brackets}": score.estimate(test.estimate, signed=True),
            "better on": f"{test.better(score.sign)} of {test.estimate.n}",
            f"could show{score.brackets}": score.number(np.nan if np.isnan(test.p) else test.estimate.detectable),
            "p": "no test" if np.isnan(test.p) else f"{test.p:.4f}",
        }
        for test in ([] if is_many(results) else tests)
    ]
    yield table_of(rows)


def _holes(report: Report, _: Figures) -> Blocks:
    """Every cell without a score, with its reason."""
    holes = report.results.holes[["label", "condition", "target", "repeat", "state", "reason"]]
    holes = holes.rename(columns={"label": "method", "condition": "display"})
    holes = holes.assign(
        repeat=holes["repeat"].map("{:.0f}".format), reason=holes["reason"].replace("", "no reason given")
    )
    yield heading("Holes")
    if holes.empty:
        yield "None: every planned cell has a score."
    else:
        yield "Cells without a score. They enter no mean, and a method without a score for every target is not ranked."
        yield table(list(holes), holes.to_numpy().tolist())


def _environment(report: Report, _: Figures) -> Blocks:
    description = report.description
    yield heading("Config and environment")
    if description.config_text:
        yield Markdown("The config, {}:").format(code(description.config_file))
        yield code_block(description.config_text)
    rows = environment(report.provenance)
    yield properties(rows) if rows else "The environment was not recorded."


def environment(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What the run used, as far as it is the same for two equal runs: no times, no paths, no revisions."""
    single = {"package": "holobench_eval", "python": "Python", "platform": "platform", "cpu": "processor", "gpu": "GPU"}
    numbers = {"threads": "threads per worker", "workers": "workers", "config_sha256": "sha256 of the config"}
    named = [(title, str(provenance[key])) for key, title in (single | numbers).items() if key in provenance]
    return [*named, *((name, str(value)) for name, value in provenance.get("packages", {}).items())]


def _has_parts(report: Report) -> bool:
    return bool(report.results.study.parts) and not report.results.study.changes


def _has_displays(report: Report) -> bool:
    return bool(report.results.conditions)


def _has_scores(report: Report) -> bool:
    values = report.results.table.get(report.results.headline.column)
    return _has_displays(report) and values is not None and bool(np.isfinite(values).any())


PARTS = (
    Part(0, _title),
    Part(2, _answer, applies=_has_displays),
    Part(3, _table, applies=_has_scores),
    Part(4, applies=_has_scores, figures=lambda report: report.once(_figures)[:1]),
    Part(6, applies=_has_scores, figures=_typical),
    Part(74, _parts, applies=_has_parts),
    Part(75, _limits, applies=_has_displays),
    Part(210, _reproduce),
    Part(1, _details, details=True),
    Part(5, _more_limits, applies=_has_displays, details=True),
    Part(10, _setup, details=True),
    Part(20, _described, applies=lambda report: report.results.study.measure != FILES, details=True),
    Part(30, applies=_has_scores, figures=lambda report: report.once(_figures)[1:], details=True),
    Part(90, figures=_stages, details=True),
    Part(120, _tests, details=True),
    Part(190, _holes, details=True),
    Part(220, _environment, details=True),
)
