"""Tables and the picture of documentation, drawn from committed reports: ``python -m tests.docs.boards``.

Between ``<!-- board: STUDY: DISPLAY, ... -->`` and ``<!-- /board -->`` stand the table and its legend; every number is
that of ``reports/STUDY/board.json``, rounded once. ``PICTURE`` has some of its rows. Between ``<!-- timings -->`` and
``<!-- /timings -->`` stand the times of a gradient step, those of ``reports/performance/timings.json``.
"""

import json
import re
from pathlib import Path
from typing import Any

from holobench_eval.commands.options import planned as plans
from holobench_eval.commands.reports.report import load
from holobench_eval.report import Results, layout_of, records_frame
from holobench_eval.report.charts.tiles import Thumbnails, draw_rows

ROOT = Path(__file__).parents[2]
PAGES = ("README.md", "docs/speed.md")
BLOCK = re.compile(r"(<!-- board: (\S+): (.*?) -->\n).*?(<!-- /board -->)", re.DOTALL)
TIMED = re.compile(r"(<!-- timings -->\n).*?(<!-- /timings -->)", re.DOTALL)
STEP, OURS = "gradient step, 1080x1920, ", "holobench_eval"
ROWS = (  # of the table: those with photographs of the picture itself, of other pictures, with none
    *("online_camera", "twin", "parametric_model", "hil_plus", "hil"),
    *("gumbel", "nearest_level", "gerchberg_saxton, smooth start", "wirtinger", "double_phase"),
)
PICTURE, SHOWN = ROOT / "docs" / "figures" / "board.jpg", ("wirtinger", "hil", "hil_plus", "twin")
UNSHOWN = "°"


def drawn(text: str) -> str:
    """A page with its tables drawn anew."""
    text = BLOCK.sub(lambda found: f"{found[1]}{table(found[2], found[3].split(', '))}\n{found[4]}", text)
    return TIMED.sub(lambda found: f"{found[1]}{timings()}\n{found[2]}", text)


def table(study: str, displays: list[str]) -> str:
    """A row a method: photographs, and on each display its mean and difference to the baseline; then the legend."""
    board = json.loads((ROOT / "reports" / study / "board.json").read_text(encoding="utf-8"))
    own, unit, targets = "With photographs of the picture itself", board["headline"]["unit"], board["targets"]
    groups = {
        display["name"]: {row["method"]: (group["name"], row) for group in display["groups"] for row in group["rows"]}
        for display in board["displays"]
    }
    heads = [f"`{name}` [{unit}] | against Wirtinger" for name in displays]
    lines = ["| method (its name here) | photographs | " + " | ".join(heads) + " |"]
    lines.append("|---|---:|" + "---:|---:|" * len(displays))
    for label in ROWS:
        found = [groups[display].get(label) for display in displays]
        group, row = next(filter(None, found))
        shared, word = (targets, " a picture") if group == own else (1, " once")
        counts = sorted({round(each["photographs"] / shared) for _, each in filter(None, found)})
        ends = dict.fromkeys((counts[0], counts[-1]))  # a twin stops by itself
        photographs = " to ".join(map(str, ends)) + word * any(ends)
        cells = " | ".join(cell for one in found for cell in cells_of(one and one[1]))
        lines.append(f"| {row['title']} (`{row['registered']}`) | {photographs} | {cells} |")
    tests = (ROOT / "reports" / study / "tests.csv").read_text(encoding="utf-8").splitlines()
    gray = next(display["floor"] for display in board["displays"] if display["name"] == displays[0])
    lines.append(
        f"\nBrackets: 95 % intervals, each of one comparison. {UNSHOWN}: not shown to differ (p ≥ 0.05, adjusted for "
        f"{len(tests) - 1} comparisons). –: not run there. A gray picture has {gray:.1f} {unit}."
    )
    return "\n".join(lines)


def cells_of(row: dict[str, Any] | None) -> tuple[str, str]:
    """Mean, and difference with its interval; dashes where the row is not there."""
    if row is None:
        return "–", "–"
    apart = row["difference"]
    if apart is None:
        return f"{row['score']['mean']:.1f}", ""
    told = UNSHOWN if row["verdict"] == "not shown to differ" else ""
    return f"{row['score']['mean']:.1f}", f"{apart['mean']:+.1f} [{apart['low']:+.1f}, {apart['high']:+.1f}]{told}"


def draw_picture(study: str, display: str) -> None:
    """Captures of ``SHOWN``: of targets whose pictures the report keeps, that of scores nearest the table's."""
    planned, records, folder, *_ = load(*next(plans(ROOT / "configs" / f"{study}.yaml", ROOT / "reports" / study)))
    layout = layout_of(planned)
    results = Results(records_frame(records, layout), layout)
    scores = {label: results.values(label, display) for label in SHOWN}
    kept = Thumbnails(results, folder)

    def apart(target: str) -> float:
        at = results.targets.index(target)
        return sum((values[at] - values.mean()) ** 2 for values in scores.values())

    def tiles(target: str) -> list[Any]:
        return [(label, kept.tile(label, display, target)) for label in SHOWN]

    pictures = kept.targets(display)
    whole = [target for target in pictures if all(tile.picture is not None for _, tile in tiles(target))]
    target = min(whole, key=apart)
    draw_rows(PICTURE, display, (target, pictures[target]), [("", tiles(target))])


def timings() -> str:
    """A row a version, two columns a distance: its time over that of this package, and its field's error."""
    timed = json.loads((ROOT / "reports" / "performance" / "timings.json").read_text(encoding="utf-8"))["benchmarks"]
    groups: dict[str, dict[str, Any]] = {}
    for row in timed:
        if row["group"].startswith(STEP):
            groups.setdefault(row["group"].removeprefix(STEP), {})[row["extra_info"]["version"]] = row
    groups = dict(sorted(groups.items(), key=lambda item: float(item[0].removesuffix(" mm"))))
    lines = [f"| version | {' | '.join(f'{distance} | error' for distance in groups)} |"]
    lines.append(f"|---|{'---:|' * 2 * len(groups)}")
    for version in next(iter(groups.values())):
        cells = []
        for rows in groups.values():
            ratio = rows[version]["stats"]["median"] / rows[OURS]["stats"]["median"]
            error = rows[version]["extra_info"].get("error")
            cells += [f"{ratio:.2f}" if ratio < 10 else f"{ratio:.0f}", "" if error is None else f"{error:.1e}"]
        lines.append(f"| {version} | {' | '.join(cells)} |")
    ours = (1e3 * rows[OURS]["stats"]["median"] for rows in groups.values())
    lines.append(f"\n`{OURS}`: {', '.join(f'{milliseconds:.0f} ms' for milliseconds in ours)}.")
    return "\n".join(lines)


if __name__ == "__main__":
    draw_picture("board", "leto-2020")
    for page in PAGES:
        (ROOT / page).write_text(drawn((ROOT / page).read_text(encoding="utf-8")), encoding="utf-8")
