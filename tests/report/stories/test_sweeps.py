"""What sweeps cost, from made-up scores whose answer is known."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from holobench_eval.report import Results, records_frame
from holobench_eval.report.facts import Facts, Swept
from holobench_eval.report.stories import answer
from holobench_eval.report.stories.sweeps import recovered, small_range, sweeps
from holobench_eval.study.definition import Claim
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


def facts(**changes: Any) -> Facts:
    kinds = {"drift": DAYS, "camera_shift_x": SHIFTS, "eye": ("-2",), "known_eye": ("-2",)}
    swept = tuple(
        Swept(kind, "leto-aged", tuple((value, title(kind, value)) for value in values))
        for kind, values in kinds.items()
    )
    conditions = ["leto-aged", *(name for one in swept for _, name in one.points)]
    pairs = tuple((label, condition) for label in NAMES for condition in conditions)
    given = {"pairs": pairs, "targets": TARGETS, "privileged": frozenset(), "reported": {}, "sweeps": swept}
    return synthetic.facts(**(given | changes))


def records() -> list[synthetic.Record]:
    found = []
    points = [("", 0.0, "leto-aged")]
    points += [(one.kind, value, name) for one in facts().sweeps for value, name in one.points]
    for label, name in NAMES.items():
        for target in TARGETS:
            for kind, value, condition in points:
                described = synthetic.cell(name, target, condition, profile="leto-aged")
                scores = {"psnr_linear": psnr(label, target, kind, value)}
                found.append(synthetic.record(label, described, scores))
    return found


def study(**changes: Any) -> Results:
    made = facts(**changes)
    return Results(records_frame(records(), made), made)


def test_losses_are_told_target_by_target() -> None:
    drift = sweeps(study())["leto-aged", "drift", "HIL"]
    losses = {point.value: point.loss and (point.loss.mean, point.loss.low, point.loss.high) for point in drift}
    assert losses == {0: None, 30: pytest.approx((3, 3, 3)), 60: pytest.approx((6, 6, 6)), 90: pytest.approx((9, 9, 9))}
    assert study().conditions == ["leto-aged"]  # changed displays have no tables of their own


def test_the_range_of_small_losses_reaches_to_the_last_point_within_it() -> None:
    drift, shift = (sweeps(study())["leto-aged", kind, "HIL"] for kind in ("drift", "camera_shift_x"))
    assert small_range(drift) == "nowhere"
    assert small_range(shift) == "-20 or less to 20 or more mm"
    assert [point.value for point in shift] == [-20, -10, 0, 10, 20]  # the unchanged display among them
    assert small_range(shift[1:]) == "-10 or less to 20 or more mm"


def test_what_a_remedy_gets_back_is_told_as_a_share_of_what_was_lost() -> None:
    swept = sweeps(study())
    eyes, cures = ({label: swept["leto-aged", kind, label] for label in NAMES} for kind in ("eye", "known_eye"))
    (share,) = recovered(study(), eyes["HIL"], cures["HIL"])
    assert share.mean == pytest.approx(7 / 8)
    assert recovered(study(), eyes["Wirtinger"], cures["Wirtinger"]) == []  # it lost nothing
    (verdict,) = answer(study(baseline="HIL"))
    assert verdict == "Of the loss comes back: 88 [88, 88] % with the same eye, known to the methods."
    assert answer(study()) == ["No eye costs Wirtinger more than 1 dB, so there is little to get back."]


WITHOUT_EYES = tuple(swept for swept in facts().sweeps if "eye" not in swept.kind)


def test_the_answer_has_the_worst_loss_and_whether_a_lead_stays() -> None:
    (text,) = answer(study(sweeps=WITHOUT_EYES, question="Does HIL stay?"))
    assert text.startswith("HIL loses 9.00 dB [9.00, 9.00] at most, with drift since calibration, 90 days.")
    assert text.endswith("It loses its lead over Wirtinger: -5.00 dB at least.")


def test_a_study_whose_baseline_is_best_is_told_of_another_method_too() -> None:
    best, other = answer(study(sweeps=WITHOUT_EYES, baseline="HIL"))
    assert best.startswith("HIL loses 9.00 dB")
    assert other.startswith("Wirtinger loses 0.00 dB")
    assert other.endswith("It has no lead over HIL to lose: -4.00 dB before.")


@pytest.mark.parametrize(
    ("claim", "verdict"),
    [
        (Claim("Nothing happens"), '"Nothing happens" does not hold for HIL: it loses 9.00 dB'),
        (Claim("Nothing happens", until=1.0), '"Nothing happens" cannot be judged for HIL'),
    ],
)
def test_a_claim_is_judged_as_far_as_it_goes(claim: Claim, verdict: str) -> None:
    changed = tuple(replace(swept, claim=claim) for swept in facts().sweeps if swept.kind == "drift")
    assert answer(study(sweeps=changed, question="Does HIL stay?"))[1].startswith(verdict)


def changed(swept: Swept, means: Mapping[str, tuple[float, ...]], key: str = "psnr_linear") -> str:
    """The answer of a study of one change; means: of each method before it and at each value, NaN for no score."""
    conditions = [swept.before, *(name for _, name in swept.points)]
    records = [
        synthetic.record(
            label,
            synthetic.cell(label, target, condition, params={"label": label}),
            {key: mean + 0.1 * index * (label == "old")} if mean == mean else {},
            state="done" if mean == mean else "failed",
        )
        for label, values in means.items()
        for condition, mean in zip(conditions, values, strict=True)
        for index, target in enumerate(TARGETS)
    ]
    return "\n".join(answer(synthetic.results(records, baseline="old", sweeps=(swept,), headline=key)))


def test_places_of_a_pupil_say_which_methods_are_above_the_baseline_at_each() -> None:
    swept = Swept("eye_pupil", "bench", (("0", "bench, at 0"), ("0.5", "bench, at 0.5")))
    text = changed(swept, {"old": (30.0, 22.0, 15.0), "new": (20.0, 21.0, 19.0), "other": (20.0, 20.0, 17.0)})
    assert text.startswith("Pupil 0.5 iris radii off axis: 2 of 2 beat old; best new, +3.85 dB [")


def test_refocusing_says_how_far_a_lens_moves_the_picture() -> None:
    swept = Swept("refocus", "bench", tuple((value, f"bench, {value:g} mm") for value in (-2.0, 1.0, 2.0)))
    text = changed(swept, {"old": (20.0, 19.4, 19.7, 19.4), "new": (20.0, 16.0, 18.0, 16.0)})
    how, where = text.split(": ")
    assert how == "A lens moves the picture at a loss of 1 dB at most"
    assert where == "-2 or less to 2 or more mm with old; nowhere with new."


@pytest.mark.parametrize(
    ("means", "told"),
    [
        ((24.0, 23.0, 22.0), "It keeps a lead over old: +1.85 dB at least."),
        ((24.0, 23.0, float("nan")), "Its lead over old is not shown to stay: +2.85 dB at least."),
        ((24.0, 23.0, 20.2), "Its lead over old is not shown to stay: +0.05 dB at least."),
        ((24.0, 23.0, 18.0), "It loses its lead over old: -2.15 dB at least."),
        ((20.2, 20.2, 20.2), "No lead is shown over old to lose: +0.05 dB before."),
    ],
)
def test_a_lead_stays_where_every_value_shows_it(means: tuple[float, ...], told: str) -> None:
    swept = Swept("drift", "bench", ((30.0, "bench, 30"), (60.0, "bench, 60")))
    assert changed(swept, {"old": (20.0, 20.0, 20.0), "new": means}).endswith(told)


def test_a_loss_without_a_score_is_no_small_loss() -> None:
    results = study(baseline="HIL", question="")
    lost = (results.frame["condition"] == title("eye", "-2")) & (results.frame["target"] == "a")
    results.frame.loc[lost, ["state", "psnr_linear"]] = "failed", float("nan")
    assert answer(results) == ["What comes back of the loss of HIL is not shown."]


def test_a_headline_without_decibels_is_told_no_small_loss() -> None:
    swept = Swept("refocus", "bench", ((1.0, "bench, 1 mm"), (2.0, "bench, 2 mm")))
    text = changed(swept, {"old": (0.9, 0.8, 0.5), "new": (0.9, 0.7, 0.4)}, key="ssim_linear")
    assert " 1 at most" not in text
    assert "dB" not in text
