"""The end of a report: how to read it, with the rules that applied, and how to make it again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ..data.results import Results
from ..data.text import FILES, words
from ..markdown import Markdown, bullets, code, code_block, heading, properties
from ..section import Blocks, Figures, Report, Section
from .alignment import agreement

EXPOSURES_PREDICTED = {
    "equal": "Equal light: the exposure of a capture follows from the target alone.",
    "matched": "Matched brightness: after a metering capture the laser power is set so that the region has the "
    "target's mean brightness.",
}
EXPOSURES = {
    "equal": "Equal light: the exposure follows from the target alone and is the same for every method, so a method "
    "that wastes light is darker before the intensity match and noisier after it.",
    "matched": "Matched brightness: after a metering capture the laser power is set so that the region has the "
    "target's mean brightness; wasted light then costs no noise.",
}


def _reading(report: Report, _: Figures) -> Blocks:
    yield heading("How to read this")
    yield bullets(Markdown("**{}.** {}").format(*note) for note in _notes(report))


def _notes(report: Report) -> Iterator[tuple[str, object]]:
    results, layout, text = report.results, report.layout, report.layout.text
    files, trained = layout.measure == FILES, bool(report.trainings)
    yield "Domains", text.domains
    hidden = [
        "the factors",
        f"the brightness ratio (mean of the {text.scored} over mean of the {text.truth}, before the match)",
    ]
    hidden += ["the efficiency (light in the scored region over light on the panel)"] * ("efficiency" in results.frame)
    yield (
        "Intensity match",
        f"One least-squares factor per colour channel, {text.compared}, without offset, then clipped to [0, 1]. It "
        f"hides wasted light; {words(hidden)} are therefore given under "
        f'"{"Light" if files else "Captures, time and light"}".',
    )
    yield "Registration", _registration(results)
    yield "Exposure", _exposure(results)
    yield "Saturation", _saturation(results)
    seeds = f"Every random number follows from the study's seed {layout.seed} and the names it depends on. "
    yield "Seeds", f"{'' if files else seeds}{text.seeds}"
    yield (
        "Intervals",
        "Student's t over clusters of targets, targets of one cluster summed; Fieller's for ratios. They show how the "
        "mean varies with other targets of the same kind, not with other displays"
        f"{' or another training of the same method' * trained}. They are of one comparison each and "
        'not adjusted: whether a difference from the baseline is "shown" is said by the paired tests alone; other '
        "differences are untested.",
    )
    yield (
        "Files",
        Markdown(
            "`table.csv` holds every mean and interval, `records.csv` every cell; the former is computed from the "
            f"latter alone. `provenance.json` holds times and {'digests of the pictures' if files else 'revisions'}."
            f"{' `training/` holds the log and the provenance of every training.' * trained}"
        ),
    )


def _registration(results: Results) -> str:
    """How the geometry was fixed, with this study's figures."""
    layout, done = results.layout, results.done
    if layout.learned_display is not None:
        return "None: the network predicts in the frame of the target, and nothing is captured."
    if layout.measure == FILES:
        return 'No fiducials; "Alignment" says where each target lies in its capture, and how that was found.'
    changed = done["condition"].isin(layout.changed)
    named = done["condition"].where(~changed, "displays after a change")
    residuals = [
        f"{condition} {' to '.join(dict.fromkeys(f'{end:.3f}' for end in (cells.min(), cells.max())))} px"
        for condition, cells in done.groupby(named, sort=False)["registration_residual_px"]
        if cells.notna().any()
    ]
    registration = (
        "Holograms of a circle grid fix the geometry once per display, the same for all methods. Residuals (rms, in "
        f"pixels of the scored region): {', '.join(residuals)}."
        if residuals
        else "No residual was recorded."
    )
    return f"{registration} {agreement(results)}".strip() if layout.real else registration


def _exposure(results: Results) -> str:
    if results.layout.learned_display is not None:
        return "No effect: without noise the unit of light changes no score."
    if results.layout.measure == FILES:
        return "Unknown. The intensity match removes its effect on brightness, not its effect on noise."
    known = EXPOSURES if not results.layout.predicts else EXPOSURES_PREDICTED
    rows = results.frame.groupby("exposure")["label"].unique()
    policies = sorted(set(rows.index) - {""})
    named = "" if len(policies) < 2 else f" This is the exposure of {words(sorted(rows.get('matched', ())))}."
    return " ".join(known.get(policy, policy) for policy in policies) + named or "Not recorded."


def _saturation(results: Results) -> str:
    if results.layout.learned_display is not None:
        return "None: there is no sensor."
    most = float(results.done["saturated"].max())
    if not most >= 0:
        return "Not recorded."
    if results.layout.measure == FILES:
        doubt = " Above 0.1 % highlights are clipped; a study on a bench would refuse the capture." * (most > 0.001)
        return f"At most {100 * most:.3g} % of a capture's samples in the scored region are at full scale.{doubt}"
    refused = "; above 0.1 % a capture is refused" if not results.layout.predicts else ""
    return f"At most {100 * most:.3g} % of a capture's samples{refused}."


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


SECTIONS = (
    Section("reading", 200, _reading, details=True),
    Section("environment", 220, _environment, details=True),
)
