"""The table and the picture of README.md, drawn from a committed report: ``python -m tests.docs.boards``.

Between ``<!-- board: STUDY: DISPLAY, ... -->`` and ``<!-- /board -->`` stand the table and its legend; every number is
that of ``reports/STUDY/board.json``, rounded once. ``PICTURE`` has some of its rows.
"""

import json
import re
from pathlib import Path
from typing import Any

from holobench_eval.commands.options import planned as plans
from holobench_eval.commands.reports.report import load
from holobench_eval.report import Results, facts_of, records_frame
from holobench_eval.report.charts.tiles import Thumbnails, draw_rows

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "README.md"
BLOCK = re.compile(r"(<!-- board: (\S+): (.*?) -->\n).*?(<!-- /board -->)", re.DOTALL)
TITLES = {
    "leto-2020": "an off-axis panel, near the paper's",
    "leto-aged": "an aged panel, on axis",
    "plm-4bit": "a panel of sixteen levels",
}
PICTURE, SHOWN = ROOT / "docs" / "figures" / "board.jpg", ("wirtinger", "hil", "twin", "online_camera")
UNSHOWN = "°"


def drawn(text: str) -> str:
    """A page with its tables drawn anew."""
    return BLOCK.sub(lambda match: f"{match[1]}{table(match[2], match[3].split(', '))}\n{match[4]}", text)


def table(study: str, displays: list[str]) -> str:
    """Of each display the best row of each access to the camera, the baseline and ``hil``, sorted; then the legend."""
    board = json.loads((ROOT / "reports" / study / "board.json").read_text(encoding="utf-8"))
    unit, of_picture = board["headline"]["unit"], "With photographs of the picture itself"
    lines = [f"| display | method | photographs | PSNR [{unit}] | against Wirtinger |", "|---|---|---:|---:|---:|"]
    for display in (next(each for each in board["displays"] if each["name"] == name) for name in displays):
        rows = [(group["name"], row) for group in display["groups"] for row in group["rows"]]
        best = {group["rows"][0]["method"] for group in display["groups"]}
        rows = [(group, row) for group, row in rows if row["method"] in best | {"hil", board["baseline"]}]
        head = f"**{TITLES[display['name']]}** <sub>{display['name']}</sub>"
        for group, row in sorted(rows, key=lambda each: -each[1]["score"]["mean"]):
            own = group == of_picture
            photographs = f"{row['photographs'] / board['targets'] ** own:.0f}{' a picture' if own else ' once'}"
            cells = [photographs if row["photographs"] else "0", f"{row['score']['mean']:.1f}", apart(row)]
            lines.append(f"| {head} | {row['title']} <sub>{row['registered']}</sub> | {' | '.join(cells)} |")
            head = ""
    tests = (ROOT / "reports" / study / "tests.csv").read_text(encoding="utf-8").splitlines()
    lines.append(
        f"\nBrackets: 95 % intervals. {UNSHOWN}: not shown to differ (p ≥ 0.05, adjusted for {len(tests) - 1} "
        f"comparisons). A gray picture has {board['displays'][0]['floor']:.1f} {unit}."
    )
    return "\n".join(lines)


def apart(row: dict[str, Any]) -> str:
    """The difference to the baseline with its interval; empty for the baseline."""
    if row["difference"] is None:
        return ""
    mean, low, high = (row["difference"][key] for key in ("mean", "low", "high"))
    return f"{mean:+.1f} [{low:+.1f}, {high:+.1f}]{UNSHOWN if row['verdict'] == 'not shown to differ' else ''}"


def draw_picture(study: str, display: str) -> None:
    """Captures of ``SHOWN``: of targets whose pictures the report keeps, that of differences nearest the mean ones."""
    planned, records, folder, *_ = load(*next(plans(ROOT / "configs" / f"{study}.yaml", ROOT / "reports" / study)))
    facts = facts_of(planned)
    results = Results(records_frame(records, facts), facts)
    kept = Thumbnails(results, folder)
    target = kept.typical(SHOWN, display)[0]
    tiles = [(label, kept.tile(label, display, target)) for label in SHOWN]
    draw_rows(PICTURE, display, (target, kept.targets(display)[target]), [("", tiles)])


if __name__ == "__main__":
    draw_picture("board", "leto-2020")
    PAGE.write_text(drawn(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
