"""From Python: the same numbers as a study, with NumPy on both sides."""

import doctest
import re
import sys
import warnings
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from skimage import data

import holobench_eval as hb
from holobench_eval import interactive
from holobench_eval.core.errors import CellError, UserError
from holobench_eval.display.training import TrainingImage
from holobench_eval.optics.colour import srgb_encode
from holobench_eval.report.charts.tiles import GAP, HEADER, SIDE, tile_size
from holobench_eval.study.config import load_study
from tests.study.studies import compute, write_study

PHASE = (1, 3, 128, 128)  # what a method returns


@pytest.fixture(scope="module")
def display():
    return hb.open_display("ideal", panel=(128, 128))


@pytest.fixture(scope="module")
def target(display):
    ramp = np.linspace(0, 1, 90, dtype=np.float32)
    return display.target(np.stack([ramp[:, None] * ramp, ramp[:, None] * ramp[::-1], ramp[:, None] + 0 * ramp], -1))


def test_the_examples_run():
    found = doctest.testmod(interactive.opened)
    assert found.attempted
    assert not found.failed


def test_what_is_public_is_there_and_nothing_else():
    assert all(getattr(hb, name) is getattr(interactive, name) for name in hb.__all__ if name[0] != "_")
    assert dir(hb) == sorted(hb.__all__)
    with pytest.raises(AttributeError, match="no attribute 'solve'"):
        _ = hb.solve  # type: ignore[attr-defined]


def test_frames_of_a_fast_panel_are_one_capture_and_a_slow_one_refuses_them(target):
    fast = hb.open_display("plm-4bit", panel=(128, 128))
    draw = np.random.default_rng(1)
    phase = fast.solve(lambda target, bench: draw.uniform(0, 6, (1, 4, 3, 128, 128)), target[:, :104, :104])
    assert phase.shape == (4, 3, 128, 128)
    picture = fast.target(np.ones((104, 104, 3), dtype=np.float32))
    images = (fast.capture(phase[0], picture), fast.capture(phase, picture))
    speckle = [np.std(image) / np.mean(image) for image in images]
    assert speckle[1] < 0.7 * speckle[0]
    with pytest.raises(UserError, match="phase has 4 frames, the display shows 1 at most in an exposure"):
        hb.open_display("ideal", panel=(128, 128)).capture(phase, target)


@pytest.mark.slow
def test_a_noise_free_display_gives_the_score_of_a_study(tmp_path, display):
    config = write_study(
        tmp_path / "study.yaml",
        "{name: gerchberg_saxton, params: {iterations: 3, initial_phase: constant}}",
        display="{profiles: [ideal], panel: [128, 128]}",
        targets="{dataset: photographs, params: {names: [coffee]}}",
        protocol="{}",
    )
    scored = compute(config, tmp_path / "out").records[-1]
    target = load_study(config).dataset.load("coffee", display.spec.region.shape)
    phase = display.solve("gerchberg_saxton", target, iterations=3, initial_phase="constant")
    found = hb.score(display.capture(phase, target), target=target)
    assert found == pytest.approx({name: scored["scores"][name] for name in found})


@dataclass(frozen=True)
class Flat:
    """A flat phase."""

    level: float = 0.0

    def solve(self, target, bench):
        return torch.full((*target.shape[:2], *bench.spec.shape), self.level)


def flat(target, bench, level=0.0):
    return Flat(level).solve(target, bench)


@pytest.mark.parametrize("kind", [torch.float32, torch.float64])
def test_a_phase_of_numpy_is_that_of_its_tensor(display, target, kind):
    phase = 6 * torch.rand(PHASE, dtype=kind)
    tensor, array = display.solve(lambda *_: phase, target), display.solve(lambda *_: phase.numpy(), target)
    assert array.dtype == tensor.dtype
    assert np.array_equal(array, tensor)


@pytest.mark.parametrize(
    ("method", "params"),
    [
        (flat, {"level": 2.0}),
        (partial(flat, level=2.0), {}),
        (partial(flat, level=1.0), {"level": 2.0}),
        (Flat, {"level": np.float32(2)}),
        (partial(Flat, level=1.0), {"level": 2.0}),
        (Flat(2.0), {}),
        (Flat(2.0).solve, {}),
        ("mine.py:flat", {"level": 2.0}),
    ],
)
def test_functions_classes_instances_partials_and_files_are_methods(tmp_path, target, method, params):
    (tmp_path / "mine.py").write_text(
        "import torch\ndef flat(target, bench, level: float = 0.0):\n"
        "    return torch.full((*target.shape[:2], *bench.spec.shape), level)\n"
    )
    opened = hb.open_display("ideal", panel=(128, 128), folder=tmp_path)
    for given in (target, torch.from_numpy(target)):
        assert np.array_equal(opened.solve(method, given, **params), np.full((3, 128, 128), 2, np.float32))


def test_a_failure_is_one_line_and_has_its_cause(display, target):
    def failing(target, bench):
        raise KeyError("two\nlines")

    with pytest.raises(CellError, match=r"^failing: KeyError: .*$") as found:
        display.solve(failing, target)
    assert isinstance(found.value.__cause__, KeyError)


def test_a_phase_file_is_shown(display, target, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    levels = np.random.default_rng(0).integers(0, 256, (128, 128, 3), dtype=np.uint8)
    (tmp_path / "phases").mkdir()
    Image.fromarray(levels).save("phases/cat.png")
    phase = display.solve("phases", target, file="phases/cat.png")
    assert phase == pytest.approx(levels.transpose(2, 0, 1) / 256 * 2 * np.pi, abs=1e-6)
    np.save("phases/cat.npy", phase)
    assert np.array_equal(display.solve("phases", target, file=Path("phases/cat.npy")), phase)


def test_a_camera_is_for_those_who_declare_it(display, target):
    def with_camera(target, bench, level=0.0):
        bench.capture(torch.full((3, 128, 128), level))
        return flat(target, bench)

    with pytest.raises(CellError, match="declares no camera"):
        display.solve(with_camera, target)
    with_camera.camera = True
    for declared in (with_camera, partial(with_camera, level=1.0)):
        assert display.solve(declared, target).shape == (3, 128, 128)


def test_levels_and_light_give_the_same_target(display, tmp_path):
    gray = np.full((50, 70), 188, np.uint8)
    light = ((188 / 255 + 0.055) / 1.055) ** 2.4
    wanted = np.full((3, *display.spec.region.shape), light)
    assert display.target(gray) == pytest.approx(wanted, abs=1e-6)
    assert display.target(np.full((50, 70, 3), light)) == pytest.approx(wanted, abs=1e-6)
    white = np.ones((50, 60), np.float32)  # a rounding beyond it is white
    assert np.array_equal(display.target(np.nextafter(white, 2)), display.target(white))


def test_colours_may_come_first_or_last(display):
    light = np.random.default_rng(0).random((50, 60, 3), dtype=np.float32)
    wanted = display.target(light)
    assert np.array_equal(display.target(light.transpose(2, 0, 1)), wanted)
    assert np.array_equal(display.target(torch.tensor(light, requires_grad=True).permute(2, 0, 1)), wanted)
    assert np.array_equal(display.target(light[None, ..., 0]), display.target(light[..., 0]))
    narrow = light[:3]  # rows, columns, colours
    assert np.array_equal(display.target(narrow), display.target(narrow.transpose(2, 0, 1).copy()))


def levels_of(light: interactive.Array) -> np.ndarray:
    return (srgb_encode(torch.from_numpy(light)) * 255).round().numpy().astype(np.uint8)


@pytest.mark.parametrize(("full", "kind"), [(255, np.uint8), (65535, np.uint16), (65535, ">u2"), (1, np.float64)])
def test_levels_of_a_picture_are_scored_as_the_light_that_they_stand_for(display, full, kind):
    levels = np.random.default_rng(1).integers(0, 256, (3, 104, 104), dtype=np.uint8)
    target = display.target(levels)
    stored = (levels / 255 * full).round(0 if full > 1 else 9).astype(kind)
    assert hb.score(stored, target=target, metrics=["psnr"], values="srgb")["psnr_linear"] == pytest.approx(80, abs=0.1)


def test_counts_of_a_camera_are_linear_light_whatever_their_type(target):
    counts = (target * 4095).astype(np.uint16)
    found = hb.score(counts, target=target, metrics=["psnr"], values="linear")
    assert found == hb.score(counts.astype(np.float64), target=target, metrics=["psnr"])
    assert found["psnr_linear"] > 60


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda d, t: d.target(np.ones((2, 50, 50))), r"a picture of \(2, 50, 50\); expected \(H, W\), \(H, W, 3\)"),
        (lambda d, t: d.target(np.full((50, 50), np.nan)), "linear light in .*; .* float64 with values from nan"),
        (lambda d, t: d.target(np.ones((50, 50), int)), "linear light in .*; this one is of int64"),
        (lambda d, t: d.target([[0.1], [0.1, 0.2]]), "a picture whose rows differ in length"),
        (lambda d, t: d.target("gone.png"), "gone.png: no such file"),
        (lambda d, t: d.target("a\0.png"), "a picture: .* is no path, since it holds a zero byte"),
        (lambda d, t: d.target(np.ma.masked_less(np.ones((50, 50)), 2)), "a picture with a mask"),
        (lambda d, t: d.solve("wirtingre", t), "did you mean 'wirtinger'"),
        (lambda d, t: d.solve("wirtinger", t, iteration=3), "did you mean 'iterations'"),
        (lambda d, t: d.solve("hil", t), "'hil' has to be trained: name it in a study"),
        (lambda d, t: d.solve(Flat(), t, level=1.0), "has its parameters already"),
        (lambda d, t: d.solve("wirtinger", t[:, 1:]), "as OpenDisplay.target gives it"),
        (lambda d, t: d.solve(lambda *_: 3, t), r"solve returned int, not a phase \(1, 3, 128, 128\)"),
        (lambda d, t: d.solve(lambda *_: torch.full(PHASE, torch.nan), t), "NaN or infinite"),
        (lambda d, t: d.solve(lambda *_: torch.arange(3.0 * 128**2).view(PHASE), t), "up to 49151: levels; expected"),
        (lambda d, t: d.solve(lambda *_: sys.exit("enough"), t), "SystemExit: enough"),
        (lambda d, t: d.solve(lambda target: 3, t), r"lambda>\(target\) cannot be called with target, bench"),
        (lambda d, t: d.solve(flat, t, levle=1), r"flat\(target, bench, level\) .* keyword argument 'levle'"),
        (lambda d, t: d.solve(partial(Flat, 1.0), t), "partial of 'Flat' with positional parameters"),
        (lambda d, t: d.solve(Flat, t, levle=1), "'Flat' has no parameter 'levle'; did you mean 'level'"),
        (lambda d, t: d.solve(int, t), "class 'int' is not a dataclass with a method 'solve'"),
        (lambda d, t: d.solve(3, t), "a method of type 'int'; expected a name"),
        (lambda d, t: d.solve("wirtinger", t * np.nan), r"a target with values from nan to nan; .* in \[0, 1\]"),
        (lambda d, t: d.solve("wirtinger", levels_of(t)), "a target of uint8; expected linear light in"),
        (lambda d, t: d.solve("phases", t, file="gone.png"), "gone.png: no such file"),
        (lambda d, t: d.solve("double_phase", "astro.png"), "target that is the path 'astro.png'; .* OpenDisplay"),
        (lambda d, t: d.solve(t, "wirtinger"), r"array in the place of its method; expected solve\(method, target\)"),
        (lambda d, t: d.solve(lambda bench, target: 3, t), r"<lambda>' takes bench and target in this order; expected"),
        (lambda d, t: d.capture(Path("a.npy"), t), "a phase that is the path 'a.npy'; .* method phases reads files"),
        (lambda d, t: d.capture(t, t), "a phase that is the target, linear light .*; expected radians"),
        (lambda d, t: d.capture(np.zeros((1, 128, 128)), t), r"phase of \(1, 128, 128\); .* shows \(3, 128, 128\)"),
        (lambda d, t: d.capture(np.ones((3, 128, 128), np.complex64), t), "phase of complex64; expected radians"),
        (lambda d, t: d.capture(np.arange(3.0 * 128**2).reshape(PHASE[1:]) % 256, t), "numbers up to 255: levels"),
        (lambda d, t: d.capture(np.full((3, 128, 128), 1e30), t), r"reaches 1e\+30 rad, where float32 has lost the"),
        (lambda d, t: d.ideal(np.full((3, 128, 128), -2.7e5)), r"reaches 2\.7e\+05 rad, .* expected it modulo 2 pi"),
        (lambda d, t: d.ideal(np.full((3, 128, 128), np.inf)), "a phase holds 49152 values that are NaN or infinite"),
        (lambda d, t: hb.open_display("ideal", panel=(256.0, 256)), r"rows and columns such as .*; got \(256.0, 256\)"),
        (lambda d, t: hb.open_display("ideal", panel=(3, 128)), "a panel has 64 to 8192 pixels a side"),
        (
            lambda d, t: hb.open_display("ideal", panel=(1081, 128)),
            r"has 1080 x 1920 pixels, not \[1081, 128\]; give at",
        ),
        (lambda d, t: hb.open_display(3), "name: expected that of a display profile, or its path; got int"),
        (lambda d, t: hb.open_display("ideal", panel=(128, 128), seed="x"), "seed: expected a whole number; got str"),
        (lambda d, t: hb.open_display("ideal", device="gpu"), "unknown device 'gpu'; auto, cpu, cuda or cuda:N"),
        (lambda d, t: hb.open_bench(3), "file: expected a path; got int"),
        (lambda d, t: hb.score(t[:, 1:], target=t), "must both be"),
        (lambda d, t: hb.score(levels_of(t), target=t), "a capture of uint8; expected values='linear'"),
        (lambda d, t: hb.score(t, target=levels_of(t)), "a target of uint8; expected linear light"),
        (lambda d, t: hb.score(levels_of(t).astype(int), target=t, values="srgb"), "of int64; as sRGB expected uint8"),
        (lambda d, t: hb.score(2 * t, target=t, values="srgb"), r"of float32; as sRGB .* floating point in \[0, 1\]"),
        (lambda d, t: hb.score(t, target=t, values="stored"), "values: expected 'linear' or 'srgb'; got 'stored'"),
        (lambda d, t: hb.score(Path("a.png"), t), "a capture that is the path 'a.png'; expected linear light"),
        (lambda d, t: hb.score(d.solve("double_phase", t), t), r"a capture that is the phase \[rad\]; expected linear"),
        (lambda d, t: hb.score(t, t, metrics="psnr"), r'metrics: expected names in a list, such as \["psnr"\]; got'),
        (lambda d, t: hb.score(t, t, metrics=["ms_ssim"]), "ms_ssim cannot be computed here of 104 x 104 pixels"),
        (lambda d, t: hb.score(t, t, metrics=("psrn",)), "did you mean 'psnr'"),
        (lambda d, t: hb.compare(t, {"a": t[:, 1:]}), r"capture 'a' of \(3, 103, 104\); expected .* \(3, 104, 104\)"),
        (lambda d, t: hb.compare(t, {"a": levels_of(t)}), "capture 'a' of uint8; expected linear light"),
        (lambda d, t: hb.compare(t, {"a": t * np.nan}), "not finite"),
        (lambda d, t: hb.compare(t, {3: t}), "captures: expected arrays by their names"),
        (lambda d, t: hb.compare(t, {"a": t}, "compared.tif"), "'compared.tif' should end in .png, .jpg, .jpeg"),
        (lambda d, t: hb.compare(t, {}), "no captures to compare"),
        (lambda d, t: hb.compare(t, {"a": t}, f"{__file__}/a.png"), "a.png' cannot be written: File exists"),
        (lambda d, t: hb.score(torch.zeros(t.shape).to_sparse(), t), "a capture as a tensor that NumPy cannot read"),
        (lambda d, t: hb.picture(t[:, 1:], t), r"a capture of \(3, 103, 104\) and a target of"),
        (lambda d, t: hb.load_records("gone"), "no records.csv"),
    ],
)
def test_a_mistake_is_told_in_one_line(display, target, call, message):
    with pytest.raises((UserError, CellError), match=message) as found:
        call(display, target)
    assert "\n" not in str(found.value)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda light: light - 0.1, "darker than the target where it is darkest, by more than 5% of its white"),
        (lambda light: light - 2.0, "darker than the target where it is darkest, by more than 5% of its white"),
        (lambda light: light[::-1], "red and blue are exchanged in the capture or in its target"),
    ],
)
def test_light_far_below_zero_and_colours_in_another_order_are_warned_of(display, change, said):
    light = display.target(data.astronaut())
    with pytest.warns(UserWarning, match=said):
        hb.score(change(np.asarray(light)), light, metrics=["psnr"])


@pytest.mark.parametrize("kind", ["f4", "f8", ">f4"])
def test_levels_as_floating_point_are_warned_of_and_light_is_not(display, kind):
    levels = data.astronaut()
    with pytest.warns(UserWarning, match="all values are levels of 255, as of a picture in sRGB, and are taken as"):
        display.target((levels / 255).astype(kind))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        light = display.target(levels)
        display.target(np.asarray(light).astype(kind))
        display.target((levels > 99).astype(kind))  # black and white is the same in both
        hb.score(np.asarray(light), light, metrics=["psnr"])
    part = (levels[:64, :64] / 255).transpose(2, 0, 1)
    with pytest.warns(UserWarning, match="all values are levels of 255"):
        hb.score(part, part, metrics=["psnr"])


def test_captures_are_compared_in_a_picture(display, target, tmp_path):
    mirrored, turned = target[:, :, ::-1], target[:, ::-1]
    path = hb.compare(target, {"mirrored": mirrored / 4, "turned": 3 * turned}, tmp_path / "new" / "compared.png")
    page = np.asarray(Image.open(path)).astype(int)
    tall, wide = tile_size(target.shape[1:])
    assert (tall, wide) == (2 * target.shape[1], 2 * target.shape[2])
    for column, picture in enumerate((target, mirrored, turned)):
        left = SIDE + column * (wide + GAP)
        tile = page[HEADER : HEADER + tall, left : left + wide]
        factors = (picture * target).sum((1, 2)) / np.square(picture).sum((1, 2))  # brightness that fits best
        light = (factors[:, None, None] * picture).clip(0, 1)
        levels = 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        wrong = np.abs(tile - levels.transpose(1, 2, 0).repeat(2, axis=0).repeat(2, axis=1)).max(-1) > 1
        assert wrong.mean() < (0.01 if column == 0 else 1e-9)  # the target has a frame around the enlarged window


def test_the_ending_says_what_a_comparison_is_and_a_folder_is_none(target, tmp_path):
    for ending, form in ((".png", "PNG"), (".PNG", "PNG"), (".jpg", "JPEG"), (".JPEG", "JPEG")):
        path = hb.compare(target, {"same": target}, tmp_path / f"compared{ending}")
        assert Image.open(path).format == form
    (tmp_path / "a.png").mkdir()
    with pytest.raises(UserError, match=r"a\.png' is a folder; expected a file in it"):
        hb.compare(target, {"same": target}, tmp_path / "a.png")


def test_records_of_a_report_are_read():
    records = hb.load_records(Path(__file__).parents[1] / "reports" / "table3")
    assert {"method", "condition", "target", "psnr_linear_db"} <= set(records.columns)


def test_what_python_shows_is_a_line_that_says_what_it_is(display, target):
    phase = display.solve("double_phase", target)
    capture = display.capture(phase, target)
    scores = hb.score(capture, target)
    handle = display._bench.for_method(Flat(), "mine", torch.from_numpy(target), "x", 0, budget=7)
    taken = display._bench.photograph(torch.from_numpy(phase), torch.from_numpy(target), "x", 0)
    image = TrainingImage("x", torch.from_numpy(target))
    shown = {
        r"<display ideal: panel of 128 x 128 pixels of .* um, .* nm, .* mm, scores 104 x 104 pixels>": display,
        r"<target, linear light in \[0, 1\]: \(3, 104, 104\), from 0 to 1>": target,
        r"<phase \[rad\]: \(3, 128, 128\), from .* to .*>": phase,
        r"<capture, linear light .*: \(3, 104, 104\), from .*>": capture,
        r"<image of the nominal model, intensity .*>": display.ideal(phase),
        r"<scores: psnr_linear \d\d\.\d\d dB, ssim_linear 0\.\d+ and \d+ more>": scores,
        r"<display ideal for mine: 0 captures, at most 7>": handle,
        r"<capture in the target's frame: light \(3, 104, 104\), residual .* px, saturated 0.00%>": taken,
        r"<capture: counts \(3, .*\), dark .*, saturated from .*>": taken.capture,
        r"<training image 'x': light \(3, 104, 104\)>": image,
    }
    for pattern, value in shown.items():
        assert re.fullmatch(pattern, repr(value)), repr(value)
    assert repr(capture[0, :2, :2]) == repr(np.asarray(capture)[0, :2, :2])
    assert type(capture * 2) is np.ndarray
    assert isinstance(capture.mean(), np.float32)
    assert np.array_equal(display.solve(lambda *_: phase[None], target), phase)


def test_a_score_takes_its_arrays_by_position_and_notices_that_they_changed_places(display, target):
    capture = display.capture(display.solve("double_phase", target), target)
    assert hb.score(capture, target, ["psnr"]) == hb.score(capture, target=target, metrics=["psnr"])
    for call in (hb.score, hb.picture):
        with pytest.raises(UserError, match=r"the target a capture; expected score\(capture, target\)"):
            call(target, capture)


def test_a_picture_is_the_capture_as_it_is_scored(display, target):
    picture = hb.picture(target / 3, target)
    assert (picture.shape, picture.dtype) == ((104, 104, 3), np.uint8)
    assert np.array_equal(picture, np.asarray(levels_of(target)).transpose(1, 2, 0))
    assert hb.picture(target[:1], target[:1]).shape == (104, 104, 3)


@pytest.mark.parametrize("convention", [{}, {"two_pi_level": [200, 220, 240.5], "sign": -1, "flip_vertical": True}])
def test_levels_of_a_phase_are_read_back(display, target, convention, tmp_path):
    phase = display.solve("double_phase", target)
    path = hb.save_levels(phase, tmp_path / "new" / "levels.png", **convention)
    assert Image.open(path).size == (128, 128)
    again = display.solve("phases", target, file=str(path), **convention)
    error = np.angle(np.exp(1j * (again - phase)))
    assert np.abs(error).max() < 1.02 * np.pi / 200
    gray = hb.save_levels(phase[:1], tmp_path / "red.png", **({} if not convention else {"two_pi_level": 200}))
    assert Image.open(gray).mode == "L"


@pytest.mark.parametrize(
    ("change", "convention", "message"),
    [
        (lambda phase: phase[:2], {}, r"a phase of \(2, 128, 128\); expected \(C, H, W\) of 1 or 3"),
        (lambda phase: phase * np.nan, {}, "a phase holds 49152 values that are NaN or infinite"),
        (lambda phase: np.round(40 * phase), {}, r"a phase has whole numbers up to \d+: levels; expected radians"),
        (lambda phase: phase.astype(np.uint8), {}, "a phase of uint8; expected radians"),
        (lambda phase: phase, {"two_pi": 256}, "the panel has no parameter 'two_pi'; did you mean 'two_pi_level'"),
        (lambda phase: phase, {"two_pi_level": (150, 200)}, "two_pi_level: 2 levels for 3 colours"),
        (lambda phase: phase, {"correction": {"file": "gone.png"}}, "gone.png"),
    ],
)
def test_what_is_no_phase_is_not_saved(display, target, tmp_path, change, convention, message):
    with pytest.raises(UserError, match=message) as caught:
        hb.save_levels(change(display.solve("double_phase", target)), tmp_path / "levels.png", **convention)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("turn", "convention", "says"),
    [
        (2 * np.pi, {}, []),
        (2 * np.pi, {"two_pi_level": 1024}, ["level 255 is the last; 75% of a turn is shown as the nearer end"]),
        (360, {}, ["the phase has values from 0.00 to 359.64, as degrees have"]),
        (0.8, {}, ["the phase has values from 0.00 to 0.80, as turns or amplitudes have"]),
    ],
)
def test_degrees_and_a_turn_out_of_reach_are_warned_of_where_levels_are_saved(tmp_path, turn, convention, says):
    phase = turn * np.linspace(0, 0.999, 64 * 64).reshape(1, 64, 64)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        hb.save_levels(phase, tmp_path / "levels.png", **convention)
    assert all(part in str(each.message) for part, each in zip(says, caught, strict=True))


def test_an_array_made_like_one_of_a_display_is_plain(display, target):
    phase = np.zeros_like(target, shape=(3, *display.spec.shape))
    assert getattr(phase, "what", "") == ""
    assert getattr(target[:, ::2], "what", "") == getattr(target, "what", "") != ""
    light = np.empty_like(display.solve("double_phase", target))
    assert getattr(light, "what", "") == ""
