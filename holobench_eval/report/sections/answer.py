"""The first page: the question of a study, the verdict on each display, how far it goes, and how to make it again."""

from __future__ import annotations

from ...core.errors import UserError
from ...core.io import read_text
from ..answers import kind_of
from ..answers.limits import FIRST, limits
from ..data.results import Results
from ..data.tables import DONE, MOST_BYTES
from ..data.text import FILES
from ..markdown import REPORT, Markdown, beginning, bullets, code, code_block, heading
from ..section import Blocks, Figures, Report, Section


def _title(report: Report, _: Figures) -> Blocks:
    return [heading(report.layout.title, 1), beginning(report.layout.question or kind_of(report.results).question)]


def _answer(report: Report, _: Figures) -> Blocks:
    yield heading("Answer")
    yield bullets(kind_of(report.results).answer(report.results))


def _parts(report: Report, _: Figures) -> Blocks:
    """The question and the answer of each part, as its own report begins."""
    yield heading("Parts")
    run = report.description.config_file or "CONFIG.yaml"
    for name in report.layout.parts:
        path = report.output / name / REPORT
        try:
            title, question, headed, answer = read_text(path, MOST_BYTES).split("\n\n", 4)[:4]
            if (title[:2], headed) != ("# ", heading("Answer")):
                raise ValueError
            yield heading(Markdown("[{}]({}/{})").format(Markdown(title[2:]), name, REPORT), 3)
            yield from (Markdown(question), Markdown(answer))
        except (UserError, OSError, ValueError) as error:
            command = f"holoeval {'run' if isinstance(error, FileNotFoundError) else 'report'} {run}/{name}"
            yield Markdown("The part {} has no report with an answer here: {} writes one.").format(name, code(command))


def _limits(report: Report, _: Figures) -> Blocks:
    found = limits(report, kind_of(report.results))
    more = Markdown("[{} more](details.md#limits)").format(len(found) - FIRST)
    yield heading("Limits")
    yield bullets([*found[:FIRST], *([more] if len(found) > FIRST else [])])


def _more_limits(report: Report, _: Figures) -> Blocks:
    yield heading("Limits")
    if report.layout.would_change:
        yield Markdown("**What would change the answer.** {}").format(report.layout.would_change)
    yield bullets(limits(report, kind_of(report.results))[FIRST:])


def _reproduce(report: Report, _: Figures) -> Blocks:
    description = report.description
    yield heading("Reproduce")
    yield code_block(description.command or f"holoeval run {description.config_file or 'CONFIG.yaml'}")
    yield Markdown("{} [details.md](details.md): displays, methods, trainings, tests, config. {}").format(
        counts(report.results), "table.csv, records.csv: every mean and every cell."
    )


def counts(results: Results) -> str:
    """How large the study is, in one sentence."""
    cells = results.frame[results.frame["category"] != "floor"]
    done = int((cells["state"] == DONE).sum())
    parts = (
        (len(results.targets), "target"),
        (cells["label"].nunique(), "method"),
        (len(results.conditions), "display"),
    )
    size = ", ".join(f"{count} {noun}{'' if count == 1 else 's'}" for count, noun in parts)
    holes = f", {len(cells) - done} without a score" if done < len(cells) else ""
    cell = "picture" if results.layout.measure == FILES else "cell"
    return f"{size}: {len(cells)} {cell}s{holes}."


def _has(report: Report) -> bool:
    return bool(report.results.conditions)


SECTIONS = (
    Section("title", 0, _title),
    Section("answer", 2, _answer, applies=_has),
    Section("parts", 74, _parts, applies=lambda report: bool(report.layout.parts)),
    Section("limits", 75, _limits, applies=_has),
    Section("reproduce", 210, _reproduce),
    Section("more limits", 5, _more_limits, applies=_has, details=True),
)
