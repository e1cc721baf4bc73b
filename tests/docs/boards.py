"""Tables of documentation that are drawn from committed reports: ``python -m tests.docs.boards``.

Between ``<!-- board: STUDY: DISPLAY, ... -->`` and ``<!-- /board -->`` stands the table; every number of it is that of
``reports/STUDY/board.json``, rounded once. Between ``<!-- timings -->`` and ``<!-- /timings -->`` stand the times of
a gradient step, those of ``reports/performance/timings.json``.
"""

import json
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
PAGES = ("README.md", "docs/speed.md")
BLOCK = re.compile(r"(<!-- board: (\S+): (.*?) -->\n).*?(<!-- /board -->)", re.DOTALL)
TIMED = re.compile(r"(<!-- timings -->\n).*?(<!-- /timings -->)", re.DOTALL)
STEP, OURS = "gradient step, 1080x1920, ", "holobench_eval"
ROWS = (  # of the table, in its order
    *("online_camera", "twin", "hil_plus", "ccnn, calibrated", "gumbel", "gerchberg_saxton, smooth start", "wirtinger"),
    *("wirtinger_veil", "hil", "double_phase"),
)


def drawn(text: str) -> str:
    """A page with its tables drawn anew."""
    text = BLOCK.sub(lambda found: f"{found[1]}{table(found[2], found[3].split(', '))}\n{found[4]}", text)
    return TIMED.sub(lambda found: f"{found[1]}{timings()}\n{found[2]}", text)


def table(study: str, displays: list[str]) -> str:
    """A row a method: photographs, and on each display its mean and difference to the baseline."""
    board = json.loads((ROOT / "reports" / study / "board.json").read_text(encoding="utf-8"))
    found = {
        display["name"]: {row["method"]: row for group in display["groups"] for row in group["rows"]}
        for display in board["displays"]
    }
    heads = [f"`{name}` [{board['headline']['unit']}] | against Wirtinger" for name in displays]
    lines = ["| method (its name here) | photographs | " + " | ".join(heads) + " |"]
    lines.append("|---|---:|" + "---:|---:|" * len(displays))
    for label in ROWS:
        rows = [found[display].get(label) for display in displays]
        row = next(filter(None, rows))
        counts = sorted({round(each["photographs"]) for each in rows if each})  # a twin stops by itself
        photographs = " to ".join(str(count) for count in dict.fromkeys((counts[0], counts[-1])))
        cells = " | ".join(cell for row in rows for cell in cells_of(row))
        lines.append(f"| {row['title']} (`{row['registered']}`) | {photographs} | {cells} |")
    return "\n".join(lines)


def cells_of(row: dict[str, Any] | None) -> tuple[str, str]:
    """Mean, and difference with its interval; dashes where the row is not there."""
    if row is None:
        return "–", "–"
    apart = row["difference"]
    if apart is None:
        return f"{row['score']['mean']:.1f}", ""
    told = " (not shown)" if row["verdict"] == "not shown to differ" else ""
    return f"{row['score']['mean']:.1f}", f"{apart['mean']:+.1f} [{apart['low']:+.1f}, {apart['high']:+.1f}]{told}"


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
    for page in PAGES:
        (ROOT / page).write_text(drawn((ROOT / page).read_text(encoding="utf-8")), encoding="utf-8")
