"""reports/performance: timings.csv with machine.json, and the report and chart that follow from these two alone."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..core.errors import UserError
from ..core.io import write_atomically
from ..report.charts.style import COLOURS, GREY, new_figure, save, style
from ..report.markdown import table
from .suite import Timing

TIMINGS, MACHINE, REPORT, CHART = "timings.csv", "machine.json", "report.md", "ratios.png"
OURS, BARE = "holobench_eval", "bare transforms"
COLUMNS = ("group", "version", "median_s", "lower_s", "upper_s", "rounds", "rows", "columns", "error", "memory_bytes")
PASSES = 8
"""Times that four transforms read or write their array, if each reads and writes it once."""
COMPLEX64 = 8
LARGEST = 10**15
"""No measurement is as large, in any unit used here."""
Number = TypeVar("Number", int, float)


def write(folder: Path, timings: Sequence[Timing], machine: dict[str, Any]) -> Path:
    """Write all four files; the report's path."""
    write_atomically(folder / TIMINGS, to_csv(timings).encode())
    write_atomically(folder / MACHINE, f"{json.dumps(machine, indent=1)}\n".encode())
    chart(timings, folder / CHART)
    write_atomically(folder / REPORT, text(from_csv(to_csv(timings)), machine).encode())
    return folder / REPORT


def problems(folder: Path) -> list[str]:
    """What no longer holds of a committed report: a line, if it does not follow from its timings."""
    try:
        timings = from_csv((folder / TIMINGS).read_text(encoding="utf-8"))
        again = text(timings, json.loads((folder / MACHINE).read_text(encoding="utf-8")))
        same = again == (folder / REPORT).read_text(encoding="utf-8")
    except (UserError, OSError) as error:
        return [str(error)]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, csv.Error) as error:  # of a damaged file
        return [f"{type(error).__name__}: {error}"]
    return [] if same else [f"{REPORT} does not follow from {TIMINGS} and {MACHINE}; run 'holoeval bench' again"]


def to_csv(timings: Sequence[Timing]) -> str:
    """A row a timing, numbers with six digits, empty where there is none."""
    lines = io.StringIO()
    writer = csv.writer(lines, lineterminator="\n")
    writer.writerow(COLUMNS)
    for one in timings:
        numbers = (one.median, one.lower, one.upper, one.rounds, *(one.padded or ("", "")), one.error, one.memory)
        shown = (f"{number:.6g}" if isinstance(number, float) else number for number in numbers)
        writer.writerow([one.group, one.version, *("" if number is None else number for number in shown)])
    return lines.getvalue()


def from_csv(content: str) -> list[Timing]:
    """The timings of a file."""
    rows = csv.DictReader(io.StringIO(content))
    if tuple(rows.fieldnames or ()) != COLUMNS:
        raise UserError(f"{TIMINGS} should have the columns {', '.join(COLUMNS)}")
    return [_timing(row) for row in rows]


def _timing(row: dict[str, str]) -> Timing:
    name = f"{TIMINGS}: {row['group']!r}, {row['version']!r}"
    rows, columns = row["rows"], row["columns"]
    return Timing(
        group=row["group"],
        version=row["version"],
        median=_positive(float(row["median_s"]), f"{name}: median_s"),
        lower=_positive(float(row["lower_s"]), f"{name}: lower_s"),
        upper=_positive(float(row["upper_s"]), f"{name}: upper_s"),
        rounds=_positive(int(row["rounds"]), f"{name}: rounds"),
        padded=(_positive(int(rows), f"{name}: rows"), _positive(int(columns), f"{name}: columns")) if rows else None,
        error=float(row["error"]) if row["error"] else None,
        memory=float(row["memory_bytes"]) if row["memory_bytes"] else None,
    )


def _positive(number: Number, name: str) -> Number:
    """The number, if it can be divided by and multiplied. UserError: no measurement gives it."""
    if not 0 < number < LARGEST:
        raise UserError(f"{name} is {number}, should be positive and less than {LARGEST:g}")
    return number


def groups(timings: Sequence[Timing]) -> dict[str, list[Timing]]:
    """Timings of the same work, in their order."""
    found: dict[str, list[Timing]] = {}
    for one in timings:
        found.setdefault(one.group, []).append(one)
    return found


def beside_others(timings: Sequence[Timing]) -> dict[str, list[Timing]]:
    """The groups in which others do the same work as this package, at an accuracy of their own."""
    return {name: rows for name, rows in groups(timings).items() if sum(row.error is not None for row in rows) > 1}


def text(timings: Sequence[Timing], machine: dict[str, Any]) -> str:
    """The report in Markdown."""
    bandwidth = _positive(machine["bandwidth"], f"{MACHINE}: bandwidth")
    found = groups(timings)
    compared = beside_others(timings)
    sizes = {name: rows for name, rows in found.items() if _bare(rows) is not None and _ours(rows) is not None}
    others = {name: rows for name, rows in found.items() if name not in compared and name not in sizes}
    dirty = ", with changes" if machine.get("dirty") else ""
    packages = ", ".join(f"{name} {number}" for name, number in machine["packages"].items())
    load = machine.get("load_before")
    busy = "" if load is None else f"; load before: {load}"
    parts = [
        "# Speed",
        "Medians of repeated calls in one run, after a warm-up, with arrays at new places in memory for each, on "
        f"{machine['threads']} threads of {machine['cpu']} ({machine['platform']}), {machine['date']}; revision "
        f"{machine['revision']}{dirty}; Python "
        f"{machine['python']}, {packages}{busy}. Memory copies {bandwidth / 1e9:.1f} GB/s (read and written). "
        "Compare ratios, not seconds; another machine has others. `holoeval bench` makes this report.",
    ]
    if compared:
        parts += [
            "## One gradient step beside others",
            "Loss and gradient of the squared intensity error, from a random phase, which fills the band: the hardest "
            "case. *error*: relative rms error of the field at the image plane against the reference setting (four "
            "times padded, complex128). *over ours*: its median over that of this package. *memory*: the most that a "
            "process of its own holds beyond what it had before. odak's frequencies lie half a sample off, so its "
            "picture is displaced; every package's documented way is timed, whatever more it computes.",
            f"![Times over that of holobench_eval, for each version and distance]({CHART})",
        ]
        for name, rows in compared.items():
            parts += [f"### {name}", _compared(rows)]
    if sizes:
        parts += [
            "## Sizes and distances",
            f"*bare* is the same number of Fourier transforms of the padded size and nothing else; *memory bound* what "
            f"{PASSES} passes of a step over the padded array ({PASSES // 2} for a propagation) would take at the "
            "bandwidth above. Padding is what the stated accuracy needs.",
            _sizes(sizes, bandwidth),
        ]
    if others:
        lines = [
            (name, one.version, *_times(one), f"{one.median / versions[0].median:.2f}", one.rounds)
            for name, versions in others.items()
            for one in versions
        ]
        parts += [
            "## The rest",
            table(("", "version", "median [ms]", "quartiles [ms]", "over the first", "calls"), lines),
        ]
    return "\n\n".join(map(str, parts)) + "\n"


def _bare(rows: Sequence[Timing]) -> Timing | None:
    return next((row for row in rows if row.version.endswith(BARE)), None)


def _ours(rows: Sequence[Timing]) -> Timing | None:
    return next((row for row in rows if row.version == OURS), None)


def _milliseconds(seconds: float) -> str:
    return f"{1e3 * seconds:.0f}" if seconds >= 0.1 else f"{1e3 * seconds:.3g}"


def _times(one: Timing) -> tuple[str, str]:
    return _milliseconds(one.median), f"{_milliseconds(one.lower)} to {_milliseconds(one.upper)}"


def _compared(rows: Sequence[Timing]) -> str:
    ours = _ours(rows)
    lines = []
    for one in rows:
        lines.append(
            (
                one.version,
                *_times(one),
                "" if ours is None else f"{one.median / ours.median:.2f}",
                f"{one.padded[0]}x{one.padded[1]}" if one.padded else "",
                "" if one.error is None else f"{one.error:.1e}",
                "" if one.memory is None else f"{one.memory / 2**20:.0f}",
                one.rounds,
            )
        )
    headings = ("version", "median [ms]", "quartiles [ms]", "over ours", "padded", "error", "memory [MiB]", "calls")
    return table(headings, lines)


def _sizes(sizes: dict[str, list[Timing]], bandwidth: float) -> str:
    lines = []
    for name, rows in sizes.items():
        ours, bare = _ours(rows), _bare(rows)
        assert ours is not None
        assert bare is not None
        if ours.padded is None:
            raise UserError(f"{TIMINGS}: {name!r}, {OURS!r}: rows and columns are missing")
        passes = PASSES if bare.version.startswith("four") else PASSES // 2
        bound = passes * COMPLEX64 * ours.padded[0] * ours.padded[1] / bandwidth
        lines.append(
            (
                name,
                f"{ours.padded[0]}x{ours.padded[1]}",
                *_times(ours),
                _milliseconds(bare.median),
                f"{ours.median / bare.median:.2f}",
                _milliseconds(bound),
            )
        )
    headings = ("", "padded", "median [ms]", "quartiles [ms]", "bare [ms]", "over bare", "memory bound [ms]")
    return table(headings, lines)


def chart(timings: Sequence[Timing], path: Path) -> None:
    """Bars: the time of every version of a step over this package's, a panel a distance; nothing without rivals."""
    compared = [rows for rows in beside_others(timings).values() if _ours(rows)]
    if not compared:
        path.unlink(missing_ok=True)  # of benchmarks that were timed before
        return
    with style():
        figure = new_figure(900, 60 + 34 * sum(len(rows) + 1 for rows in compared))
        axes = figure.subplots(len(compared), 1, sharex=True, squeeze=False)[:, 0]
        longest = 1.0
        for axis, rows in zip(axes, compared, strict=True):
            ours = _ours(rows)
            assert ours is not None
            ratios = np.array([one.median / ours.median for one in rows])
            colours = [COLOURS[0] if one is ours else GREY for one in rows]
            axis.barh(range(len(rows)), ratios, color=colours)
            axis.set_yticks(range(len(rows)), [one.version for one in rows])
            axis.invert_yaxis()
            axis.set_xscale("log")
            axis.axvline(1, color=COLOURS[0], linewidth=0.8)
            axis.set_title(rows[0].group, loc="left")
            for place, (one, ratio) in enumerate(zip(rows, ratios, strict=True)):
                shown = f"{ratio:.0f}" if ratio >= 10 else f"{ratio:.2g}"
                words = f"{shown}  ({1e3 * one.median:.0f} ms)"
                on_line = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
                axis.text(ratio * 1.03, place, words, va="center", fontsize=8, bbox=on_line)
                longest = max(longest, ratio)
            axis.set_xlim(right=3 * longest)
            axis.xaxis.set_major_formatter("{x:g}")
        axes[-1].set_xlabel("time over that of holobench_eval")
        figure.tight_layout()
        save(figure, path)
