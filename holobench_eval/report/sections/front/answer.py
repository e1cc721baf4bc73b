"""The question of a study, the answer that its records give, and how far the answer goes."""

from __future__ import annotations

from ...answers import kind_of
from ...answers.kind import MOST_SENTENCES, named
from ...answers.limits import limits
from ...markdown import Markdown, beginning, bullets, heading
from ...section import Blocks, Figures, Report, Section


def _render(report: Report, _: Figures) -> Blocks:
    layout, kind = report.layout, kind_of(report.results)
    sentences = kind.answer(report.results)
    yield heading("Question")
    yield beginning(layout.question or kind.question)
    if layout.would_change:
        yield Markdown("**What would change the answer.** {}").format(layout.would_change)
    yield heading("Answer")
    yield bullets(sentences)
    about = named(report.results, " ".join([layout.question, *sentences]))
    if about:
        yield "The names that occur here:"
        yield bullets(Markdown("**{}**: {}").format(name, text) for name, text in about.items())
    yield heading("Limits", 3)
    yield bullets(limits(report, kind))


def _rest(report: Report, _: Figures) -> Blocks:
    yield heading("More of the answer")
    yield bullets(kind_of(report.results).whole_answer(report.results)[MOST_SENTENCES - 1 :])


def _is_long(report: Report) -> bool:
    return len(kind_of(report.results).whole_answer(report.results)) > MOST_SENTENCES


SECTIONS = (
    Section("answer", 2, _render, applies=lambda report: bool(report.results.conditions)),
    Section("more of the answer", 2, _rest, applies=_is_long, details=True),
)
