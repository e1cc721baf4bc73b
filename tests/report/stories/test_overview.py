"""How far an answer goes."""

from pathlib import Path
from typing import Any

import pytest

from holobench_eval.report.description import Description
from holobench_eval.report.stories.overview import limits
from holobench_eval.report.story import Report
from tests.support import synthetic_study as synthetic


def limited(alone: tuple[str, ...] = (), provenance: dict[str, Any] | None = None, **changes: Any) -> str:
    """The limits of a study; alone: targets that were solved with nothing beside them."""
    records = [
        synthetic.record(label, synthetic.cell(label, target, "ideal"), {"psnr_linear": 20.0}, alone=target in alone)
        for label in ("GS", "Wirtinger")
        for target in synthetic.TARGETS
    ]
    report = Report(synthetic.results(records, **changes), records, Path("none"), provenance or {}, Description())
    return "\n".join(limits(report))


@pytest.mark.parametrize(
    ("alone", "workers", "expected"),
    [
        (synthetic.TARGETS[:1], 2, "**Seconds:** of holograms that were solved with nothing beside them."),
        ((), 2, "**Seconds:** of 2 workers side by side, so longer than alone."),
        ((), 1, ""),
    ],
)
def test_a_reader_is_told_what_was_at_work_beside_what_was_timed(alone, workers, expected) -> None:
    text = limited(alone, {"workers": workers})
    assert expected in text
    assert ("**Seconds:**" in text) == bool(expected)


@pytest.mark.parametrize(("wanted", "missed"), [(None, True), (("psnr", "lpips_alex"), True), (("psnr",), False)])
def test_lpips_is_missed_only_where_it_was_wanted(wanted: tuple[str, ...] | None, missed: bool) -> None:
    assert ("**LPIPS:**" in limited(metrics=wanted)) == missed
