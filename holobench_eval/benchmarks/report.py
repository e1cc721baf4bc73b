"""reports/performance: timings.csv with machine.json, and the report and chart that follow from these two alone."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

from ..core.errors import UserError
from ..core.io import write_atomically
from ..report.charts.style import COLOURS, GREY, new_figure, save, style
from ..report.markdown import table
from .suite import Timing

TIMINGS, MACHINE, REPORT, CHART = "timings.csv", "machine.json", "report.md", "ratios.png"
OURS, BARE = "holobench_eval", "bare transforms"
COLUMNS = tuple(field.name for field in fields(Timing))
TEXTS, WHOLE_NUMBERS, ANY_SIGN = ("group", "version"), ("rounds", "rows", "columns"), ("error", "memory_bytes")
BESIDE = ("version", "median [ms]", "quartiles [ms]", "over ours", "padded", "error", "memory [MiB]", "calls")
SIZES = ("", "padded", "median [ms]", "quartiles [ms]", "bare [ms]", "over bare", "memory bound [ms]")
OTHERS = ("", "version", "median [ms]", "quartiles [ms]", "over the first", "calls")
PASSES = 8  # times that four transforms read or write their array, if each reads and writes it once
COMPLEX64 = 8  # bytes
LARGEST = 10**15  # no measurement is as large, in any unit used here


def write(folder: Path, timings: Sequence[Timing], machine: dict[str, Any]) -> Path:
    """Write all four files; the report's path."""
    content = to_csv(timings)
    write_atomically(folder / TIMINGS, content.encode())
    write_atomically(folder / MACHINE, f"{json.dumps(machine, indent=1)}\n".encode())
    chart(timings, folder / CHART)
    write_atomically(folder / REPORT, text(from_csv(content), machine).encode())
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
    for timing in timings:
        writer.writerow(f"{value:.6g}" if isinstance(value, float) else value for value in astuple(timing))
    return lines.getvalue()


def from_csv(content: str) -> list[Timing]:
    """The timings of a file. UserError: it has other columns, or numbers that no measurement gives."""
    rows = csv.DictReader(io.StringIO(content))
    if tuple(rows.fieldnames or ()) != COLUMNS:
        raise UserError(f"{TIMINGS} should have the columns {', '.join(COLUMNS)}")
    return [
        Timing(**{column: _value(column, cell, row) for column, cell in row.items() if cell or column in TEXTS})
        for row in rows
    ]


def _value(column: str, cell: str, row: dict[str, str]) -> Any:
    if column in TEXTS:
        return cell
    number = int(cell) if column in WHOLE_NUMBERS else float(cell)
    return (
        number
        if column in ANY_SIGN
        else _positive(number, f"{TIMINGS}: {row['group']!r}, {row['version']!r}: {column}")
    )


def _positive(number: float, name: str) -> float:
    """The number, if it can be divided by and multiplied. UserError: no measurement gives it."""
    if not 0 < number < LARGEST:
        raise UserError(f"{name} is {number}, should be positive and less than {LARGEST:g}")
    return number


def groups(timings: Sequence[Timing]) -> dict[str, list[Timing]]:
    """Timings of the same work, in their order."""
    work: dict[str, list[Timing]] = {}
    for timing in timings:
        work.setdefault(timing.group, []).append(timing)
    return work


def beside_others(timings: Sequence[Timing]) -> dict[str, list[Timing]]:
    """The groups in which others do the same work as this package, at an accuracy of their own."""
    return {name: rows for name, rows in groups(timings).items() if sum(row.error is not None for row in rows) > 1}


def text(timings: Sequence[Timing], machine: dict[str, Any]) -> str:
    """The report in Markdown."""
    bandwidth = _positive(machine["bandwidth"], f"{MACHINE}: bandwidth")
    work, compared = groups(timings), beside_others(timings)
    pairs = {
        name: (ours, bare)
        for name, rows in work.items()
        if (ours := _version(rows, OURS)) and (bare := _version(rows, BARE))
    }
    others = [
        (name, row.version, *_times(row), f"{row.median_s / rows[0].median_s:.2f}", row.rounds)
        for name, rows in work.items()
        for row in rows
        if name not in compared and name not in pairs
    ]
    dirty = ", with changes" if machine.get("dirty") else ""
    packages = ", ".join(f"{name} {number}" for name, number in machine["packages"].items())
    load = machine.get("load_before")
    busy = "" if load is None else f"; load before: {load}"
    parts = [
        "# Speed",
        "Medians of repeated calls in one run, after a warm-up, with arrays at new places in memory for each, on "
        f"{machine['threads']} threads of {machine['cpu']} ({machine['platform']}), {machine['date']}; revision "
        f"{machine['revision']}{dirty}; Python {machine['python']}, {packages}{busy}. Memory copies "
        f"{bandwidth / 1e9:.1f} GB/s (read and written). Compare ratios, not seconds; another machine has others. "
        "`holoeval bench` makes this report.",
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
            *(f"### {name}\n\n{_compared(rows)}" for name, rows in compared.items()),
        ]
    if pairs:
        parts += [
            "## Sizes and distances",
            "*bare* is the same number of Fourier transforms of the padded size and nothing else; *memory bound* what "
            f"{PASSES} passes of a step over the padded array ({PASSES // 2} for a propagation) would take at the "
            "bandwidth above. Padding is what the stated accuracy needs.",
            table(SIZES, [_size(name, *pair, bandwidth) for name, pair in pairs.items()]),
        ]
    if others:
        parts += ["## The rest", table(OTHERS, others)]
    return "\n\n".join(map(str, parts)) + "\n"


def _version(rows: Sequence[Timing], ending: str) -> Timing | None:
    return next((row for row in rows if row.version.endswith(ending)), None)


def _milliseconds(seconds: float) -> str:
    return f"{1e3 * seconds:.0f}" if seconds >= 0.1 else f"{1e3 * seconds:.3g}"


def _times(row: Timing) -> tuple[str, str]:
    return _milliseconds(row.median_s), f"{_milliseconds(row.lower_s)} to {_milliseconds(row.upper_s)}"


def _padded(row: Timing) -> str:
    return f"{row.rows}x{row.columns}" if row.rows else ""


def _compared(rows: Sequence[Timing]) -> str:
    ours = _version(rows, OURS)
    lines = [
        (
            row.version,
            *_times(row),
            "" if ours is None else f"{row.median_s / ours.median_s:.2f}",
            _padded(row),
            "" if row.error is None else f"{row.error:.1e}",
            "" if row.memory_bytes is None else f"{row.memory_bytes / 2**20:.0f}",
            row.rounds,
        )
        for row in rows
    ]
    return table(BESIDE, lines)


def _size(name: str, ours: Timing, bare: Timing, bandwidth: float) -> tuple[str, ...]:
    """The row of a size and distance beside the same number of bare transforms."""
    if ours.rows is None or ours.columns is None:
        raise UserError(f"{TIMINGS}: {name!r}, {OURS!r}: rows and columns are missing")
    passes = PASSES if bare.version.startswith("four") else PASSES // 2
    bound = passes * COMPLEX64 * ours.rows * ours.columns / bandwidth
    ratio = f"{ours.median_s / bare.median_s:.2f}"
    return name, _padded(ours), *_times(ours), _milliseconds(bare.median_s), ratio, _milliseconds(bound)


def chart(timings: Sequence[Timing], path: Path) -> None:
    """Bars: the time of every version of a step over this package's, a panel a distance; nothing without rivals."""
    compared = [(rows, ours) for rows in beside_others(timings).values() if (ours := _version(rows, OURS))]
    if not compared:
        path.unlink(missing_ok=True)  # of benchmarks that were timed before
        return
    with style():
        figure = new_figure(900, 60 + 34 * sum(len(rows) + 1 for rows, _ in compared))
        axes = figure.subplots(len(compared), 1, sharex=True, squeeze=False)[:, 0]
        longest = max(row.median_s / ours.median_s for rows, ours in compared for row in rows)
        for axis, (rows, ours) in zip(axes, compared, strict=True):
            ratios = [row.median_s / ours.median_s for row in rows]
            axis.barh(range(len(rows)), ratios, color=[COLOURS[0] if row is ours else GREY for row in rows])
            axis.set_yticks(range(len(rows)), [row.version for row in rows])
            axis.invert_yaxis()
            axis.set_xscale("log")
            axis.axvline(1, color=COLOURS[0], linewidth=0.8)
            axis.set_title(rows[0].group, loc="left")
            for position, (row, ratio) in enumerate(zip(rows, ratios, strict=True)):
                words = f"{f'{ratio:.0f}' if ratio >= 10 else f'{ratio:.2g}'}  ({1e3 * row.median_s:.0f} ms)"
                on_line = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
                axis.text(ratio * 1.03, position, words, va="center", fontsize=8, bbox=on_line)
            axis.xaxis.set_major_formatter("{x:g}")
        axes[0].set_xlim(right=3 * longest)  # shared by all
        axes[-1].set_xlabel("time over that of holobench_eval")
        figure.tight_layout()
        save(figure, path)
