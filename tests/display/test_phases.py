"""What is odd about a phase is said, and nothing of a right one."""

import math
import re
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from skimage import data
from torch import Tensor
from typer.testing import CliRunner

import holobench_eval as hb
from holobench_eval.commands import app
from holobench_eval.core.errors import CellError
from holobench_eval.display import DisplaySpec, load_profile, phases
from holobench_eval.display.nominal import ideal_light
from holobench_eval.display.phases import check_phase, phase_doubt, unit_doubt
from holobench_eval.optics.phase import FARTHEST

TAU = math.tau
PANEL = (128, 128)
FEW = {"iterations": 30}
OPEN = {"double_phase": {}, "double_phase_aa": {}, "double_phase_bl": {}, "hio": {}}
OPEN |= {"gerchberg_saxton": {"initial_phase": "random"}}
OPEN |= {"wirtinger": FEW, "sgd": FEW, "multi_plane": FEW}
OPEN |= {"wirtinger smooth": {"iterations": 100, "initial_phase": "constant"}}


def optics(spec: DisplaySpec, factor: float = 1.0, order: tuple[int, ...] = (0, 1, 2)) -> DisplaySpec:
    """A display that a phase for ``factor`` times its distance and lasers in that order suits not, nor one of its."""
    return replace(spec, distance=spec.distance / factor, wavelengths=tuple(spec.wavelengths[c] for c in order))


GEOMETRIES = {  # of the display, what the phase is for beside it, and by which method
    "nearer": (
        "double_phase",
        lambda spec: optics(spec, 0.85),
        r"at about 0.8[345]\d* times the distance, or for a pitch",
    ),
    "further": ("gerchberg_saxton", lambda spec: optics(spec, 1.35), r"at about 1.3[456]\d* times the distance, or"),
    "a pitch": (
        "gerchberg_saxton",
        lambda spec: replace(spec, pitch=spec.pitch * 6.4 / 3.74),
        r"at about [23]\.\d* times the distance, or for a pitch of [67]\.\d* um",
    ),
    "blue first": (
        "double_phase",
        lambda spec: optics(spec, order=(2, 1, 0)),
        "the lasers were in the order blue, green",
    ),
    "green first": ("gerchberg_saxton", lambda spec: optics(spec, order=(1, 0, 2)), "in the order green, red, blue"),
}


def by_colour(phase: Tensor, *factors: float) -> Tensor:
    return torch.tensor(factors)[:, None, None] * phase


DEGREES, LEVELS, DRAW = np.degrees(1.0), 255.99 / TAU, torch.Generator()
TURNS = TAU * torch.tensor([-1.0, 0.0, 1.0])[:, None, None]
CHECKERS = math.pi * ((torch.arange(128)[:, None] + torch.arange(128)) % 2)
ODD = {
    "the other sign": (lambda phase: -phase, "fits its target better with the opposite sign (correlation"),
    "left to right": (lambda phase: phase.flip(-1), "better mirrored left to right"),
    "top to bottom": (lambda phase: phase.flip(-2), "better mirrored top to bottom"),
    "half a turn": (lambda phase: phase.flip((-1, -2)), "better turned by 180 degrees"),
    "transposed": (lambda phase: phase.mT, "better transposed"),
    "both": (lambda phase: -phase.flip(-1), "better with the opposite sign, mirrored left to right"),
    "blue first": (lambda phase: phase.flip(0), "better with red and blue exchanged"),
    "degrees": (lambda phase: DEGREES * phase, "better read as degrees"),
    "degrees of both signs": (lambda phase: DEGREES * ((phase + math.pi) % TAU - math.pi), "better read as degrees"),
    "degrees that are not wrapped": (lambda phase: DEGREES * (phase + TURNS), "better read as degrees"),
    "levels": (lambda phase: LEVELS * phase, "better read as levels of 8 bits"),
    "turns": (lambda phase: phase / TAU, "better read as turns"),
    "turns of both signs": (lambda phase: (phase / TAU + 0.5) % 1 - 0.5, "better read as turns"),
    "half turns": (lambda phase: phase / math.pi, "better read as half turns"),
    "half turns of both signs": (lambda phase: (phase / math.pi + 1) % 2 - 1, "better read as half turns"),
    "levels over their number": (lambda phase: (phase / TAU * 255).round() / 255, "better read as turns"),
    "a ninth": (lambda phase: phase / 9, "better multiplied by 9"),
    "levels of 10 bits in a file of 16": (lambda phase: 2**-6 * phase, "better multiplied by 6"),
    "ten times": (lambda phase: 10 * phase, "better multiplied by 0.1"),
    "no turn of each colour": (
        lambda phase: by_colour(phase, 0.78125, 0.625, 0.5),
        "multiplied by 1.28, 1.6, 2, colour",
    ),
    "turns of red and blue": (lambda phase: by_colour(phase, 22 / 15, 1.0, 15 / 22), "by another two_pi_level (corr"),
    "green first": (lambda phase: phase[[1, 0, 2]], "better with red and green exchanged"),
    "blue, red, green": (lambda phase: phase[[2, 0, 1]], "with its colours in the order green, blue, red"),
    "halves": (lambda phase: phase.roll((64, 64), (-2, -1)), "better with its halves exchanged (fftshift)"),
    "left and right": (lambda phase: phase.roll(64, -1), "better with its left and right halves exchanged"),
    "the picture's halves": (lambda phase: phase + CHECKERS, "half a turn added to every other pixel (fftshift of"),
    "all halves": (
        lambda phase: phase.roll((64, 64), (-2, -1)) + CHECKERS,
        "every other pixel and its halves exchanged",
    ),
    "aside": (lambda phase: phase.roll((3, -2), (-2, -1)), "with its picture moved by -3 rows and 2 columns"),
    "noise": (lambda phase: 6 * torch.rand(phase.shape, generator=DRAW.manual_seed(1)), "makes nothing like"),
}


@pytest.fixture(scope="module", params=["ideal", "leto-2020"])
def display(request: pytest.FixtureRequest) -> hb.OpenDisplay:
    return hb.open_display(request.param, panel=PANEL)


@pytest.fixture(scope="module")
def target(display: hb.OpenDisplay) -> Tensor:
    return torch.from_numpy(display.target(data.coffee()))


@pytest.fixture(scope="module")
def solved(display: hb.OpenDisplay, target: Tensor) -> Callable[[str], Tensor]:
    """The phase of the target by a method, found once."""
    return cache(lambda method: torch.from_numpy(display.solve(method.split()[0], target, **OPEN[method])))


@pytest.fixture(scope="module")
def phase(solved: Callable[[str], Tensor]) -> Tensor:
    return solved("gerchberg_saxton") % TAU


def test_a_right_phase_is_not_remarked_on(display: hb.OpenDisplay, target: Tensor, solved) -> None:
    assert {method: remark for method in OPEN if (remark := phase_doubt(solved(method), target, display.spec))} == {}


def test_what_fits_better_is_named(display: hb.OpenDisplay, target: Tensor, phase: Tensor) -> None:
    for kind, (change, remark) in ODD.items():
        assert remark in phase_doubt(change(phase), target, display.spec), kind
    even = torch.arange(3.0)[:, None, None].expand(3, *PANEL)
    assert phase_doubt(even, target, display.spec).startswith("makes nothing like its target")


@pytest.mark.parametrize("kind", GEOMETRIES)
def test_optics_that_a_phase_was_made_for_are_named(display: hb.OpenDisplay, target: Tensor, solved, kind: str) -> None:
    method, change, remark = GEOMETRIES[kind]
    assert re.search(remark, phase_doubt(solved(method), target, change(display.spec)))


def test_a_distance_is_named_beside_a_sign_and_a_pose_and_one_laser_for_all(display, target, solved) -> None:
    nearer = optics(display.spec, 0.8)
    remark = phase_doubt(-solved("double_phase").flip(-1), target, nearer)
    assert re.search(r"opposite sign, at about (0.79|0.8)\d* times the distance, .*, mirrored left to right", remark)
    red = solved("double_phase")[:1].expand(3, -1, -1)
    assert "as if all lasers were of about 6" in phase_doubt(red, target[:1].expand(3, -1, -1), display.spec)


def test_what_has_no_name_is_told_by_its_correlation_unless_the_display_was_seen(display, target, phase) -> None:
    y, x = torch.meshgrid(*2 * [torch.linspace(-1, 1, PANEL[0])], indexing="ij")
    bent = phase + 2 * TAU * (torch.sin(2 * x + y) - x * y)  # a correction map
    said = phase_doubt(bent, target, display.spec)
    assert re.match(r"makes its target less well than phases for these optics can \(correlation 0\.\d\d with", said)
    assert phase_doubt(bent % TAU, target, display.spec, seen=True) == ""
    assert phase_doubt(bent, target, display.spec, computed=True) == ""
    assert "opposite sign" in phase_doubt(-phase, target, display.spec, computed=True)


def test_a_right_phase_takes_one_propagation(display, target, solved, monkeypatch) -> None:
    taken = []
    monkeypatch.setattr(phases, "ideal_light", lambda *given: taken.append(given) or ideal_light(*given))
    assert phase_doubt(solved("double_phase"), target, display.spec) == ""
    assert len(taken) == 1


def test_a_phase_is_right_whose_levels_a_panel_lacks() -> None:
    opened = hb.open_display("flc-1bit", panel=PANEL)
    target = torch.from_numpy(opened.target(data.coffee()))
    found = torch.from_numpy(opened.solve("double_phase", target))
    assert phase_doubt(found, target, opened.spec) == ""
    assert "opposite sign" in phase_doubt(-found, target, opened.spec)


FOURIER = {  # each by its number of pixels a side
    "right": (lambda phase, n: phase, ""),
    "the other sign": (lambda phase, n: -phase, "better with the opposite sign (c"),
    "left to right": (lambda phase, n: phase.flip(-1), "better mirrored left to right (c"),
    "halves": (lambda phase, n: phase.roll((n // 2, n // 2), (-2, -1)), "with its halves exchanged (fftshift)"),
    "rows": (lambda phase, n: phase.roll(n // 2, -2), "with its upper and lower halves exchanged"),
    "the picture's halves": (lambda phase, n: phase + CHECKERS.repeat(2, 2), "half a turn added to every other pixel"),
    "a pixel aside": (lambda phase, n: phase + math.pi * torch.arange(n) / n, "moved by 0 rows and -1 columns"),
    "above": (lambda phase, n: (phase - math.tau * torch.arange(n)[:, None] / n) % TAU, "by 2 rows and 0 columns"),
}


def test_what_goes_wrong_before_a_lens_is_named() -> None:
    opened = hb.open_display("pluto-fourier", panel=(256, 256))
    target = torch.from_numpy(opened.target(data.coffee()[..., 1]))
    found = torch.from_numpy(opened.solve("gerchberg_saxton", target))
    for kind, (change, remark) in FOURIER.items():
        said = phase_doubt(change(found, 256), target, opened.spec)
        assert remark in said if remark else said == "", kind


@pytest.mark.parametrize("method", ["double_phase", "gerchberg_saxton", "wirtinger smooth"])
@pytest.mark.parametrize("factors", [(220 / 256, 180 / 256, 150 / 256), (220 / 150, 1.0, 150 / 220)])
def test_a_full_turn_of_each_colour_is_named_though_the_picture_is_still_there(
    display: hb.OpenDisplay, target: Tensor, solved, method: str, factors: tuple[float, ...]
) -> None:
    read = by_colour(solved(method) % TAU, *factors)
    assert "colour by colour, as by another two_pi_level" in phase_doubt(read, target, display.spec)
    read[2] = 1.3  # a colour that is dark has no turn
    assert "e+0" not in phase_doubt(read, target * torch.tensor([1.0, 1.0, 0.0])[:, None, None], display.spec)


def test_a_unit_is_named_for_values_that_do_not_fill_its_span(display: hb.OpenDisplay, target: Tensor, solved) -> None:
    smooth = (solved("wirtinger") % TAU).clamp(0.1 * TAU, 0.9 * TAU)
    for kind in ("turns", "levels over their number", "degrees", "levels"):
        change, remark = ODD[kind]
        assert remark in phase_doubt(change(smooth), target, display.spec)


def test_a_unit_is_told_by_its_jumps_where_it_does_not_fill_its_span(phase: Tensor) -> None:
    degrees = DEGREES * phase.clamp(0.1 * TAU, 0.9 * TAU)
    assert unit_doubt(degrees).endswith("as degrees have")
    assert unit_doubt(phase.clamp(0.1, 0.9) / TAU).endswith("as turns or amplitudes have")
    smooth = torch.linspace(-15, 15, 128) ** 2  # a lens [rad], not wrapped
    assert unit_doubt(phase) == unit_doubt(5 * phase) == unit_doubt((smooth[:, None] + smooth)[None]) == ""


@pytest.mark.parametrize(("method", "contrast"), [("double_phase", 0.01), ("gerchberg_saxton", 0.07)])
def test_a_right_phase_of_a_nearly_even_target_is_not_remarked_on(display, method: str, contrast: float) -> None:
    rows, columns = (torch.arange(n) // 16 for n in display.spec.region.shape)
    checks = ((rows[:, None] + columns) % 2).expand(3, -1, -1)
    even = 0.5 + contrast * checks
    found = torch.from_numpy(display.solve(method, even)) % TAU
    assert phase_doubt(found, even, display.spec) == ""


def test_an_amplitude_in_the_place_of_a_phase_is_named_whatever_its_unit(display, target: Tensor) -> None:
    spec = display.spec
    planes = [spec.region.embed(plane.sqrt(), spec.shape).to(torch.complex64) for plane in target]
    back = torch.stack([spec.propagator(c).adjoint(plane) for c, plane in enumerate(planes)]).abs()
    for largest in (0.1, 1.0, 2.5, 9.0, 255.5, 360.0):
        assert phase_doubt(largest * back / back.max(), target, spec).startswith("grows with the amplitude of"), largest


@pytest.mark.parametrize("method", ["double_phase", "gerchberg_saxton"])
@pytest.mark.parametrize("largest", [0.35, 1.0, 2.0, 255.5, 360.0])
def test_a_cause_is_named_only_where_it_makes_the_target(display, target, solved, method: str, largest: float) -> None:
    own = solved(method)
    magnitude = ((own + math.pi) % TAU - math.pi).abs()
    for values in (magnitude / magnitude.max(), torch.rand(own.shape, generator=DRAW.manual_seed(2))):
        remark = phase_doubt(largest * values, target, display.spec)
        assert re.match(r"makes (nothing like|little of) its target \(values from .* to \d+\.\d\d; correlation", remark)


def test_nothing_is_said_where_there_is_nothing_to_compare_or_no_light(display, target, phase) -> None:
    shape = (3, *display.spec.shape)
    draw = torch.rand(shape, generator=torch.Generator().manual_seed(2))
    assert phase_doubt(torch.full(shape, 3.0), target, display.spec) == ""
    assert phase_doubt(6 * draw, torch.full_like(target, 0.5), display.spec) == ""
    fine = (torch.arange(target.shape[-1]) // 2 % 2).expand_as(target).float()
    assert phase_doubt(6 * draw, fine, display.spec) == ""
    red = target * torch.tensor([1.0, 0.0, 0.0]).view(3, 1, 1)
    assert phase_doubt(phase, red, display.spec) == ""
    assert "opposite sign" in phase_doubt(-phase, red, display.spec)


def test_a_phase_that_was_found_with_the_camera_is_not_warned_of() -> None:
    opened = hb.open_display("leto-aged", panel=PANEL)
    target = opened.target(data.coffee())
    found = opened.solve("online_camera", target, captures=12)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        opened.capture(found, target)
    with pytest.warns(UserWarning, match="the phase makes|the phase fits"):
        opened.capture(-found, target)


class Spy(torch.Tensor):
    """A tensor that would run its own code inside the bench."""


@pytest.mark.parametrize(
    ("phase", "message"),
    [
        (torch.full((3, *PANEL), math.nan), "phase holds 49152 values that are NaN or infinite"),
        (torch.full((3, *PANEL), 1e300, dtype=torch.float64), "phase holds 49152 values that are NaN or infinite"),
        (torch.zeros(2, 3, *PANEL), "phase has 2 frames, the display shows 1 at most in an exposure"),
        (torch.zeros(1, 1, 3, *PANEL), r"phase is \(1, 1, 3, 128, 128\)"),
        (torch.zeros(3, *PANEL, dtype=torch.complex64), "phase is torch.complex64"),
        (torch.zeros(3, *PANEL).as_subclass(Spy), "phase is Spy, the display shows a plain"),
    ],
)
def test_what_no_display_can_show_is_refused_by_the_name_of_its_method(phase: Tensor, message: str) -> None:
    with pytest.raises(CellError, match=f"^mine: {message}"):
        check_phase(phase, load_profile("ideal").spec(PANEL), "mine")


def test_a_phase_is_shown_as_long_as_single_precision_has_its_place_in_the_turn() -> None:
    check_phase(torch.full((3, *PANEL), FARTHEST), load_profile("ideal").spec(PANEL), "")
    assert float(np.spacing(np.float32(0.99 * FARTHEST))) < TAU / 256 < float(np.spacing(np.float32(FARTHEST)))


def test_a_capture_in_python_warns_of_an_odd_phase_alone(display: hb.OpenDisplay, target, phase) -> None:
    with pytest.warns(UserWarning, match="^the phase fits its target better with the opposite sign"):
        display.capture(-phase, target)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        display.capture(phase, target)


STUDY = """
title: Files
seed: 3
display: {profiles: [ideal], panel: [128, 128]}
targets: {dataset: photographs, params: {names: [coffee, astronaut]}}
protocol: {metrics: [psnr]}
methods:
  - {name: gerchberg_saxton, params: {iterations: 5}}
  - {name: phases, label: right, params: {file: "{target}.npy"}}
  - {name: phases, label: wrong, params: {file: "{target}.npy", sign: -1}}
"""


def test_a_study_names_odd_files_on_the_terminal_and_in_its_report(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    opened = hb.open_display("ideal", panel=PANEL)
    for name in ("coffee", "astronaut"):
        target = opened.target(getattr(data, name)())
        np.save(f"{name}.npy", opened.solve("gerchberg_saxton", target, iterations=5))
    Path("study.yaml").write_text(STUDY)
    done = CliRunner().invoke(app, ["run", "study.yaml", "--executor", "serial", "--threads", "1", "--output", "out"])
    assert done.exit_code == 0, done.output
    for said in (done.output, Path("out/report.md").read_text()):
        (line,) = (line.replace("*", "") for line in said.splitlines() if "Check the phases of" in line)
        assert "Check the phases of wrong on ideal" in line
        assert "or coffee and 1 more, the phase fits its target better with the opposite sign (correlation" in line
    remarks = pd.read_csv("out/records.csv").set_index("label")["phase_remark"]
    assert remarks["wrong"].str.startswith("fits its target better").all()
    assert remarks.drop("wrong").isna().all()
