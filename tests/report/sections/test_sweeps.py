"""What sweeps cost, from made-up scores whose answer is known."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from holobench_eval.report import Description, write_report
from holobench_eval.report.facts import Layout, Swept
from holobench_eval.report.results import Results
from holobench_eval.report.data.sweeps import Sweep, sweeps
from holobench_eval.report.results import records_frame
from tests.support import synthetic_study as synthetic

TARGETS = ("a", "b", "c", "d")
DAYS = (30.0, 60.0, 90.0)
SHIFTS = (-20.0, -10.0, 10.0, 20.0)
NAMES = {"Wirtinger": "wirtinger", "HIL": "hil"}


def title(kind: str, value: float | str) -> str:
    return f"leto-aged, {kind} {value}"


def psnr(label: str, target: str, kind: str = "", value: float | str = 0.0) -> float:
    """HIL begins 4 dB above Wirtinger; drift costs it 0.1 dB a day, a shift 0.05 dB a mm, glasses 8 dB."""
    base = 15.0 + TARGETS.index(target)
    if label == "Wirtinger":
        return base
    lost = {"": 0.0, "drift": 0.1, "camera_shift_x": 0.05}.get(kind, 0.0) * abs(float(value) if kind != "eye" else 0)
    return base + 4.0 - lost - (8.0 if kind == "eye" else 1.0 if kind == "known_eye" else 0.0)


def layout() -> Layout:
    kinds = {"drift": DAYS, "camera_shift_x": SHIFTS, "eye": ("-2",), "known_eye": ("-2",)}
    swept = tuple(
        Swept(kind, "leto-aged", tuple((value, title(kind, value)) for value in values))
        for kind, values in kinds.items()
    )
    conditions = ["leto-aged", *(name for one in swept for _, name in one.points)]
    return synthetic.layout(
        pairs=tuple((label, condition) for label in NAMES for condition in conditions),
        targets=TARGETS,
        privileged=frozenset(),
        reported={},
        sweeps=swept,
    )


def records() -> list[synthetic.Record]:
    found = []
    points = [("", 0.0, "leto-aged")]
    points += [(one.kind, value, name) for one in layout().sweeps for value, name in one.points]
    for label, name in NAMES.items():
        for target in TARGETS:
            for kind, value, condition in points:
                described = synthetic.cell(name, target, condition, profile="leto-aged")
                scores = {"psnr_linear": psnr(label, target, kind, value)}
                found.append(synthetic.record(label, described, scores))
    return found


@pytest.fixture
def results() -> Results:
    return Results(records_frame(records(), layout()), layout())


def of(results: Results, kind: str) -> Sweep:
    return next(sweep for sweep in sweeps(results) if sweep.swept.kind == kind)


def test_losses_are_told_target_by_target(results: Results) -> None:
    drift = of(results, "drift")
    value, loss = drift.worst("HIL") or pytest.fail("no loss")
    assert (value, loss.mean, loss.low, loss.high) == pytest.approx((90, 9, 9, 9))


def test_the_range_of_small_losses_reaches_to_the_last_point_within_it(results: Results) -> None:
    shift = of(results, "camera_shift_x")
    assert of(results, "drift").small_range("HIL") == "nowhere"
    assert shift.small_range("HIL") == "-20 or less to 20 or more mm"
    assert [value for value, _ in shift.points] == [-20, -10, 0, 10, 20]  # the unchanged display among them
    assert results.conditions == ["leto-aged"]  # changed displays have no tables of their own


def test_what_a_remedy_gets_back_is_told_as_a_share(results: Results) -> None:
    (share,) = of(results, "eye").recovered("HIL", of(results, "known_eye")).values()
    assert share.mean == pytest.approx(7 / 8)
    assert of(results, "eye").recovered("Wirtinger", of(results, "known_eye")) == {}  # it lost nothing


def test_a_report_with_sweeps_has_curves(tmp_path: Path) -> None:
    text = write_report(layout(), records(), tmp_path, {}, Description())[0].read_text()
    for kind in ("drift", "camera_shift_x", "eye", "known_eye"):
        assert f"(figures/quality-sweep-{kind}.png)" in text
        assert np.ptp(Image.open(tmp_path / "figures" / f"quality-sweep-{kind}.png").convert("L")) > 200  # is drawn
