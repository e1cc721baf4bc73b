"""The head of a report, and what was measured: the setup, the displays, the methods."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...study.plan import is_reference
from ..data.layout import FLOOR, TrainingSet
from ..data.results import Results
from ..data.text import FILES, plain
from ..markdown import Markdown, bullets, code, code_block, heading, properties, table
from ..section import Blocks, Figures, Report, Section
from ..stories.alignment import agreement

TARGETS_NAMED = 40


def _setup(report: Report, _: Figures) -> Blocks:
    layout = report.layout
    yield heading("What was measured")
    yield layout.text.procedure
    yield properties(_from_files(report) if layout.measure == FILES else _on_displays(report))


def _described(report: Report, _: Figures) -> Blocks:
    layout, displays = report.layout, report.description.displays
    yield heading("Displays and methods")
    yield layout.text.displays if displays else "No description of the displays was recorded."
    for display in displays:
        yield heading(f"Display {display.name}", 3)
        yield display.heading
        yield bullets(display.lines)
    yield heading("Methods", 3)
    yield _methods(report)


def _details(report: Report, _: Figures) -> Blocks:
    yield heading(Markdown("Details: {}").format(report.layout.title), 1)
    yield Markdown("What [report.md](report.md) rests on, number by number.")


def _on_displays(report: Report) -> list[tuple[str, str]]:
    """Name and value of everything that was the same for all methods."""
    layout, cells = report.layout, [record["cell"] for record in report.records]
    sets = dict.fromkeys(f"{cell['dataset']} ({plain(cell['dataset_params'])})" for cell in cells)
    panels = dict.fromkeys(" x ".join(map(str, cell["panel"])) + " pixels" for cell in cells)
    return [
        *([("measured", f"predictions of the captures of holograms by {layout.holograms}")] * layout.predicts),
        _targets(report.results),
        ("dataset", "; ".join(sets)),
        *([("training images", _training_images(layout.training))] if layout.training else []),
        ("panel", "; ".join(panels)),
        ("exposure", _distinct(report.results, "exposure")),
        ("metric protocol", _distinct(report.results, "protocol")),
        ("repeats", str(report.results.frame["repeat"].nunique())),
        ("seed", str(layout.seed)),
        ("headline metric", report.results.headline.axis),
        ("baseline", layout.baseline or "none"),
        ("registration", _registration(report.results)),
        ("saturated samples of a capture", _saturation(report.results)),
    ]


def _from_files(report: Report) -> list[tuple[str, str]]:
    """The same where the pictures were given."""
    cells = [record["cell"] for record in report.records if not is_reference(record["cell"]["condition"])]
    sizes = dict.fromkeys(" x ".join(map(str, cell["panel"])) for cell in cells if cell["panel"])
    return [
        _targets(report.results),
        ("size of the captures", f"{'; '.join(sizes)} pixels"),
        ("compared", report.layout.text.compared),
        ("metric protocol", _distinct(report.results, "protocol")),
        ("headline metric", report.results.headline.axis),
        ("baseline", report.layout.baseline or "none"),
        ("saturated samples of a capture", _saturation(report.results)),
    ]


def _registration(results: Results) -> str:
    """How far the geometry was off, display by display, and whether a second aligner agrees."""
    layout, done = results.layout, results.done
    if layout.learned_display is not None:
        return "none: the network predicts in the frame of the target"
    changed = done["condition"].isin(layout.changed)
    named = done["condition"].where(~changed, "displays after a change")
    residuals = [
        f"{condition} {' to '.join(dict.fromkeys(f'{end:.3f}' for end in (cells.min(), cells.max())))} px"
        for condition, cells in done.groupby(named, sort=False)["registration_residual_px"]
        if cells.notna().any()
    ]
    found = f"rms residual, in pixels of the scored region: {', '.join(residuals)}" if residuals else "not recorded"
    return f"{found}. {agreement(results)}" if layout.real else found


def _saturation(results: Results) -> str:
    if results.layout.learned_display is not None:
        return "none: there is no sensor"
    most = float(results.done["saturated"].max())
    return f"at most {100 * most:.3g} %" if most >= 0 else "not recorded"


def _targets(results: Results) -> tuple[str, str]:
    more = len(results.targets) - TARGETS_NAMED
    names = ", ".join(results.targets[:TARGETS_NAMED])
    count, clusters = len(results.targets), len(set(results.clusters))
    among = f" in {clusters} cluster{'s' * (clusters > 1)}" if clusters < count else ""
    return "targets", f"{count}{among}: {names}{f' and {more} more' if more > 0 else ''}"


def _training_images(given: TrainingSet) -> str:
    limit = "no limit on captures" if given.captures is None else f"at most {given.captures} captures"
    return f"{given.images} of {given.dataset}, of which {given.held_out} only watch the training; {limit}"


def _distinct(results: Results, column: str) -> str:
    return ", ".join(sorted(set(results.frame[column]) - {""}))


def _methods(report: Report) -> Markdown:
    """Label, registered name and parameters of every method, in the order of the tables."""
    cells = {record["label"]: record["cell"] for record in report.records}
    planned = report.results.table["category"] != FLOOR
    rows = []
    for label in dict.fromkeys(report.results.table.loc[planned, "label"]):
        cell = cells[label]
        limit = f"; at most {cell['captures']} captures per target" if cell.get("captures") else ""
        rows.append([label, code(cell["method"]), f"{plain(cell['params'])}{limit}"])
    return table(["method", "registered as", "parameters"], rows)


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
    Section("details", 1, _details, details=True),
    Section("setup", 10, _setup, details=True),
    Section("displays and methods", 20, _described, lambda report: report.layout.measure != FILES, details=True),
    Section("environment", 220, _environment, details=True),
)
