"""reports/performance: timings.csv with machine.json, and the report and chart that follow from these two alone."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import Field, TypeAdapter, ValidationError

from ..core.errors import UserError
from ..core.io import write_atomically
from ..report.charts.style import GREY, SHADES, new_figure, save, style
from ..report.markdown import Markdown, bullets, table

T = TypeVar("T")
# No measurement is as large, in any unit used here. What is divided by is positive.
Positive = Annotated[float, Field(gt=0, lt=1e15)]
Count = Annotated[int, Field(gt=0, lt=10**15)]


@dataclass(frozen=True)
class Timing:
    """Seconds that one version takes for its group's work: median and quartiles over ``rounds`` turns, steady heap.

    rows, columns: of its padded transforms; error: relative rms error of its field at the image plane; memory_bytes:
    the most that it held; faults: of pages, in a call; the last three: the same in a fresh process. None: not measured.
    """

    group: str
    version: str
    median_s: Positive
    lower_s: Positive
    upper_s: Positive
    rounds: Count
    rows: Count | None = None
    columns: Count | None = None
    error: float | None = None
    memory_bytes: float | None = None
    faults: int | None = None
    fresh_s: Positive | None = None
    fresh_memory_bytes: float | None = None
    fresh_faults: int | None = None


TIMINGS, MACHINE, REPORT, CHART = "timings.csv", "machine.json", "report.md", "ratios.png"
OURS, BARE = "holobench_eval", "bare transforms"
COLUMNS = tuple(field.name for field in fields(Timing))
TIMING = TypeAdapter(Timing)
BANDWIDTH: TypeAdapter[float] = TypeAdapter(Positive)
PASSES = 8  # times that four transforms read or write their array, if each reads and writes it once
COMPLEX64 = 8  # bytes


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
        _valid(TIMING, {column: cell or None for column, cell in row.items()}, f"{TIMINGS}, line {rows.line_num}: ")
        for row in rows
    ]


def _valid(adapter: TypeAdapter[T], value: Any, place: str) -> T:
    """The value in its type. UserError: it is of another, or no measurement gives it."""
    try:
        return adapter.validate_python(value)
    except ValidationError as error:
        fault = error.errors()[0]
        name = ".".join(map(str, fault["loc"]))
        raise UserError(f"{place}{name}: {fault['msg']}, got {str(fault['input'])[:60]}") from None


def groups(timings: Sequence[Timing]) -> dict[str, list[Timing]]:
    """Timings of the same work, in their order."""
    work: dict[str, list[Timing]] = {}
    for timing in timings:
        work.setdefault(timing.group, []).append(timing)
    return work


def beside_others(timings: Sequence[Timing]) -> dict[str, list[Timing]]:
    """The groups in which others do the same work as this package, in processes of their own."""
    return {name: rows for name, rows in groups(timings).items() if any(row.fresh_s is not None for row in rows)}


def text(timings: Sequence[Timing], machine: dict[str, Any]) -> str:
    """The report in Markdown."""
    bandwidth = _valid(BANDWIDTH, machine["bandwidth"], f"{MACHINE}: bandwidth")
    work, compared = groups(timings), beside_others(timings)
    pairs = {
        name: (ours, bare)
        for name, rows in work.items()
        if (ours := _version(rows, OURS)) and (bare := _version(rows, BARE))
    }
    others = [
        {"": name, "version": row.version}
        | _times(row)
        | {"over the first": _over(row.median_s, rows[0].median_s), "turns": str(row.rounds)}
        for name, rows in work.items()
        for row in rows
        if name not in compared and name not in pairs
    ]
    parts = [
        "# Speed",
        f"Medians over turns of one run, in which the versions of the same work alternate, on {machine['threads']} "
        f"threads of {_made_on(machine)}. Memory copies {bandwidth / 1e9:.1f} GB/s (read and written). Compare ratios, "
        "not seconds; another machine has others. `holoeval bench` makes this report.",
        "*Steady*: the C library's heap keeps all memory, so that no call of any version waits for new pages; arrays "
        "lie at new places in each turn. *Fresh*: a process as any program starts it, in which large arrays come from "
        "the system each time, unless a package prevents it, as this one does. Everything is measured in a steady heap "
        "unless it says otherwise, and ratios in a steady heap are those to quote.",
    ]
    if absent := _absent(machine):
        parts.append(bullets(absent))
    if compared:
        parts += [
            "## One gradient step beside others",
            f"Times over that of {OURS}, steady (fresh). Where a number is below 1, the other is faster.",
            _headline(compared),
            f"![Times over that of {OURS}, for each version and distance]({CHART})",
            "Loss and gradient of the squared intensity error, from a random phase, which fills the band: the hardest "
            "case. Each version has a process of its own. *error*: relative rms error of the field at the image plane "
            "against the reference setting (four times padded, complex128). *over ours*: its median over that of this "
            "package. *memory*: the most that its process holds during a call, on one thread, beyond what it had "
            "before anything was prepared. odak's frequencies lie half a sample off, so its picture is displaced. "
            "Every package's documented way is timed, whatever more it computes.",
            *(f"### {name}\n\n{_compared(rows)}" for name, rows in compared.items()),
        ]
    if pairs:
        parts += [
            "## Sizes and distances",
            "*bare* is the same number of Fourier transforms of the padded size by torch and nothing else; *memory "
            f"bound* what {PASSES} passes of a step over the padded array ({PASSES // 2} for a propagation) would take "
            "at the bandwidth above. Padding is what the stated accuracy needs.",
            _table([_size(name, *pair, bandwidth) for name, pair in pairs.items()]),
        ]
    if others:
        parts += ["## The rest", _table(others)]
    return "\n\n".join(map(str, parts)) + "\n"


def _made_on(machine: dict[str, Any]) -> str:
    """Processor, date, revision, packages and load."""
    dirty = ", with changes" if machine.get("dirty") else ""
    packages = ", ".join(f"{name} {number}" for name, number in machine["packages"].items())
    loads = [(when, machine.get(f"load_{when}")) for when in ("before", "after")]
    busy = "".join(f"; load {when}: {load}" for when, load in loads if load is not None)
    return (
        f"{machine['cpu']} ({machine['platform']}), {machine['date']}; revision {machine['revision']}{dirty}; Python "
        f"{machine['python']}, {packages}{busy}"
    )


def _absent(machine: dict[str, Any]) -> list[str]:
    """A line for each package that is not installed, and for each case that failed."""
    missing = [
        f"Not timed, since {name} is not installed: {'; '.join(of)}" for name, of in machine.get("missing", {}).items()
    ]
    return missing + [f"Not timed: {name}: {reason}" for name, reason in machine.get("faults", {}).items()]


def _table(rows: Sequence[dict[str, str]]) -> Markdown:
    """Rows of cells by the head of their column."""
    return table(tuple(rows[0]), [tuple(row.values()) for row in rows])


def _headline(compared: dict[str, list[Timing]]) -> Markdown:
    """A row a version, a column a group: its time over that of this package."""
    versions = dict.fromkeys(row.version for rows in compared.values() for row in rows if row.version != OURS)
    lines = [(version, *(_ratios(rows, version) for rows in compared.values())) for version in versions]
    return table(("", *compared), lines)


def _ratios(rows: Sequence[Timing], version: str) -> str:
    ours, other = _version(rows, OURS), _version(rows, version)
    if ours is None or other is None:
        return ""
    fresh = _over(other.fresh_s, ours.fresh_s)
    return _over(other.median_s, ours.median_s) + (f" ({fresh})" if fresh else "")


def _over(time: float | None, reference: float | None) -> str:
    return f"{time / reference:.2f}" if time and reference else ""


def _version(rows: Sequence[Timing], ending: str) -> Timing | None:
    return next((row for row in rows if row.version.endswith(ending)), None)


def _milliseconds(seconds: float) -> str:
    return f"{1e3 * seconds:.0f}" if seconds >= 0.1 else f"{1e3 * seconds:.3g}"


def _times(row: Timing) -> dict[str, str]:
    quartiles = f"{_milliseconds(row.lower_s)} to {_milliseconds(row.upper_s)}"
    return {"median [ms]": _milliseconds(row.median_s), "quartiles [ms]": quartiles}


def _padded(row: Timing) -> str:
    return f"{row.rows}x{row.columns}" if row.rows else ""


def _mebibytes(size: float | None) -> str:
    return "" if size is None else f"{size / 2**20:.0f}"


def _compared(rows: Sequence[Timing]) -> Markdown:
    ours = _version(rows, OURS)
    median, fresh = (ours.median_s, ours.fresh_s) if ours else (None, None)
    lines = [
        {
            "version": row.version,
            **_times(row),
            "over ours": _over(row.median_s, median),
            "fresh [ms]": "" if row.fresh_s is None else _milliseconds(row.fresh_s),
            "over ours, fresh": _over(row.fresh_s, fresh),
            "padded": _padded(row),
            "error": "" if row.error is None else f"{row.error:.1e}",
            "memory [MiB]": _mebibytes(row.memory_bytes),
            "memory, fresh [MiB]": _mebibytes(row.fresh_memory_bytes),
            "page faults, steady / fresh": "" if row.fresh_faults is None else f"{row.faults:,} / {row.fresh_faults:,}",
            "turns": str(row.rounds),
        }
        for row in rows
    ]
    return _table(lines)


def _size(name: str, ours: Timing, bare: Timing, bandwidth: float) -> dict[str, str]:
    """The row of a size and distance beside the same number of bare transforms."""
    if ours.rows is None or ours.columns is None:
        raise UserError(f"{TIMINGS}: {name!r}, {OURS!r}: rows and columns are missing")
    passes = PASSES if bare.version.startswith("four") else PASSES // 2
    bound = passes * COMPLEX64 * ours.rows * ours.columns / bandwidth
    return {
        "": name,
        "padded": _padded(ours),
        **_times(ours),
        "bare [ms]": _milliseconds(bare.median_s),
        "over bare": _over(ours.median_s, bare.median_s),
        "memory bound [ms]": _milliseconds(bound),
    }


def chart(timings: Sequence[Timing], path: Path) -> None:
    """Times of every version of a step over this package's, a panel a distance: bars, dots where the process is fresh.

    Without rivals nothing.
    """
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
            axis.barh(range(len(rows)), ratios, color=[SHADES[0] if row is ours else GREY for row in rows])
            axis.set_yticks(range(len(rows)), [row.version for row in rows])
            axis.invert_yaxis()
            axis.set_xscale("log")
            axis.axvline(1, color=SHADES[0], linewidth=0.8)
            axis.set_title(rows[0].group, loc="left")
            for position, (row, ratio) in enumerate(zip(rows, ratios, strict=True)):
                words = f"{f'{ratio:.0f}' if ratio >= 10 else f'{ratio:.2g}'}  ({1e3 * row.median_s:.0f} ms)"
                furthest = ratio
                if row.fresh_s is not None and ours.fresh_s is not None:
                    fresh = row.fresh_s / ours.fresh_s
                    axis.plot(fresh, position, "o", color="black", markersize=3)
                    furthest = max(ratio, 1.03 * fresh)
                on_line = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
                axis.text(furthest * 1.03, position, words, va="center", fontsize=8, bbox=on_line)
            axis.xaxis.set_major_formatter("{x:g}")
        axes[0].set_xlim(right=3 * longest)  # shared by all
        axes[-1].set_xlabel("time over that of holobench_eval; bars: steady heap, dots: fresh process")
        figure.tight_layout()
        save(figure, path)
