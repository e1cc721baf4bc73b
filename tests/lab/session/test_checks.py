"""Sessions of photographs: checks of a live bench, dark counts, signs, places, frames, and the scores of an import."""

import csv
import itertools
import json
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
import yaml
from PIL import Image

import holobench_eval.display.simulated.profile as profiles
from holobench_eval.core.errors import UserError
from holobench_eval.core.hashing import digest
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.lab.session import Pattern, read_manifest, session_photographer
from holobench_eval.lab.session.checks import check_swaps, grain
from holobench_eval.lab.session.folder import FolderPhotographer
from holobench_eval.lab.session.manifest import CHECKS
from holobench_eval.optics.colour import srgb_encode
from holobench_eval.study.config import load_study
from holobench_eval.study.displays import displays
from tests.lab.session.running import exported, succeed, told
from tests.study.studies import write_study
from tests.support.photographing import Lab

LAB = ("leto-mild", (144, 144), 4)
LATER = ("leto-mild", (144, 144), 5)  # another noise


def test_checks_come_before_any_score_and_may_be_photographed_again_until_they_pass(tmp_path: Path) -> None:
    session = exported(tmp_path, "double_phase", "leto-mild")
    Lab(*LAB).photograph_round(session, 1)
    for sign, gamma, words in (
        (-1, 1.0, "nothing was scored. phase convention: .* set phase.sign: -1"),
        (1, 0.8, "linearity: r^2 .* is there gamma"),
    ):
        Lab(*LATER, sign=sign).photograph_checks(session, gamma=gamma)
        assert re.search(words.replace("^", r"\^"), told("import", session)[1])
    Lab(*LATER).photograph_checks(session)
    photograph = next((session / "captures" / "checks").glob("*.png"))
    content = photograph.read_bytes()
    photograph.unlink()
    assert "checks: nothing was scored. missing: captures/checks/" in told("import", session)[1]
    assert not (session / "report" / "report.md").exists()
    photograph.write_bytes(content)
    said, failure = told("import", session)
    assert not failure
    lines = [line for line in said.splitlines() if "linearity:" in line or "phase convention:" in line]
    assert [line.split(":")[0] for line in lines] == ["channel 0", "channel 1", "channel 2", "phase convention"]
    assert all("r^2 1.0000" in line or "r^2 0.9999" in line for line in lines[:3])
    assert "upright" in lines[3]
    assert "phase convention: upright" in (session / "report" / "report.md").read_text().lower().replace("**", "")


def test_a_camera_with_one_exposure_checks_the_sign_alone(tmp_path: Path) -> None:
    folder = exported(tmp_path, "double_phase", "leto-mild", "--fixed-exposure")
    roles = [each.role for each in read_manifest(folder).of_round(CHECKS)]
    assert roles == [role for role in ("dark", "letter", "reversed") for _ in range(3)]
    Lab(*LATER).photograph_checks(folder)
    said, failure = told("import", folder)
    assert "linearity: not checked, since the session has one exposure" in said
    assert "phase convention:" in said
    assert "none of the" in failure


PROFILE = Path(profiles.__file__).parent / "profiles" / "leto-mild.yaml"
DARK = 900  # of the lab


@pytest.mark.parametrize("kind", ["level", "file of the bench"])
def test_given_dark_counts_stand_for_dark_frames(tmp_path: Path, kind: str) -> None:
    lab, options = Lab(*LAB, dark=DARK), ("--dark", DARK)
    if kind == "file of the bench":
        np.save(tmp_path / "my dark.npy", np.full(lab.bench.response.shape[-2:], DARK, np.float32))
        options = described(tmp_path, capture={"dark_frames": 0, "dark": "my dark.npy"})
    folder = exported(tmp_path, "double_phase", "leto-mild", *options)
    for name in ("round-1", "checks"):
        rows = list(csv.DictReader((folder / "patterns" / name / "order.csv").read_text().splitlines()))
        assert {row["laser"] for row in rows} == {"on"}
    lab.photograph_round(folder, 1)
    photographer = FolderPhotographer(folder)
    pattern = photographer.manifest.of_round(1)[0]
    light, counts = photographer.light(pattern), photographer.counts(pattern)
    assert np.allclose(light * pattern.exposure, counts - DARK, atol=1e-2)
    if kind == "file of the bench":
        (copy,) = folder.glob("dark-*.npy")
        np.save(copy, np.zeros(counts.shape, np.float32))
        with pytest.raises(UserError, match="has changed since the session was exported"):
            FolderPhotographer(folder).light(pattern)


def described(folder: Path, **bench: object) -> tuple[str, Path]:
    """The options of an export with a bench file."""
    panel = yaml.safe_load(PROFILE.read_text())["panel"] | {"shape": [144, 144]}
    (folder / "dark.yaml").write_text(yaml.safe_dump({"name": "lab", "version": 1, "panel": panel, **bench}))
    return "--bench", folder / "dark.yaml"


def test_given_dark_counts_go_before_those_of_the_bench_file_whatever_the_files_are_called(tmp_path: Path) -> None:
    for name, level in (("dark.npy", 64), ("new/dark.npy", 80)):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        np.save(tmp_path / name, np.full((100, 100), level, np.uint16))
    options = described(tmp_path, capture={"dark_frames": 0, "dark": "dark.npy"})
    folder = exported(tmp_path, "double_phase", "leto-mild", *options, "--dark", tmp_path / "new" / "dark.npy")
    assert FolderPhotographer(folder).dark_of(1, 0).bias.mean() == 80


@pytest.mark.parametrize(
    ("ending", "dark", "line"),
    [
        (".png", np.uint8(20), "has 8 bits and the photograph 16"),
        (".jpg", np.uint8(20), "compressed with loss, no counts to take dark ones off"),
    ],
)
def test_photographs_on_another_scale_than_the_given_dark_counts_are_a_fault(tmp_path, ending, dark, line) -> None:
    np.save(tmp_path / "dark.npy", np.full((100, 100), dark))
    folder = exported(tmp_path, "double_phase", "leto-mild", *described(tmp_path), "--dark", tmp_path / "dark.npy")
    photographer, draw = FolderPhotographer(folder), np.random.default_rng(0)
    for pattern in photographer.manifest.of_round(CHECKS):
        counts = draw.integers(0, 250, (100, 100)).astype(np.uint16) * (1 if ending == ".jpg" else 256)
        picture = Image.fromarray(counts.astype(np.uint8) if ending == ".jpg" else counts)
        picture.save(folder / f"{pattern.capture}{ending}")
    faults, _ = photographer.check_round(CHECKS)
    assert any(line in fault for fault in faults), faults


def refused(folder: Path, profile: str, lab: Lab) -> str:
    """The one line with which the import of photographs from a lab ends."""
    session = exported(folder, "double_phase", profile)
    lab.photograph_round(session, 1)
    return told("import", session)[1]


@pytest.mark.parametrize("profile", ["leto-mild", "leto-aged"])  # without and with a ghost of the grid
def test_photographs_of_the_conjugate_pattern_name_the_sign(tmp_path: Path, profile: str) -> None:
    line = refused(tmp_path, profile, Lab(profile, (144, 144), seed=3, sign=-1))
    assert "the likely cause is the sign of the phase" in line
    assert "set phase.sign: -1 in the bench file" in line


def test_a_picture_that_is_out_of_focus_for_another_reason_does_not_name_the_sign(tmp_path: Path) -> None:
    lab = Lab("leto-mild", (144, 144), seed=3)
    panel = replace(lab.bench.profile.panel, distance=1.5 * lab.bench.profile.panel.distance)
    lab.bench = SimulatedBench(replace(lab.bench.profile, panel=panel))
    line = refused(tmp_path, "leto-mild", lab)
    assert "the photographs do not tell whether phase.sign: 1 is right" in line


METHODS = (
    "double_phase, {name: wirtinger, params: {iterations: 30}}, "
    "{name: wirtinger, label: rough, params: {iterations: 30, initial_phase: random}}"
)


def swap(first: Path, second: Path) -> None:
    content = first.read_bytes(), second.read_bytes()
    first.write_bytes(content[1])
    second.write_bytes(content[0])


def test_each_swap_of_two_methods_is_named_in_one_line_and_no_honest_pair_is(tmp_path: Path) -> None:
    folder = exported(tmp_path, METHODS, "leto-2020", "--dark", 900)
    Lab("leto-2020", (144, 144), seed=5).photograph_round(folder, 1)
    shown = [pattern for pattern in read_manifest(folder).patterns if pattern.target]
    pairs = []
    for colour, places in enumerate(itertools.combinations(range(3), 2)):  # another pair of methods in each colour
        of_colour = [pattern for pattern in shown if pattern.colour == colour]
        pairs.append([of_colour[place].capture for place in places])
    for first, second in pairs:
        swap(folder / f"{first}.png", folder / f"{second}.png")
    said, line = told("import", folder)
    for first, second in pairs:
        assert f"wrong order: {first} and {second}, of one target, changed places" in line, said
        swap(folder / f"{first}.png", folder / f"{second}.png")
    assert line.count("wrong order") == 3
    said, line = told("import", folder)
    assert not line
    assert "table.csv" in said
    assert "checks: not photographed" in said
    assert "wrong order" not in said


def pictures(alike: float, seed: int = 0) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Grains of two photographs and of their predictions, of which a part ``alike`` is the same in both."""
    draw = np.random.default_rng(seed)
    common = draw.exponential(size=(100, 100))
    wanted = [alike * common + (1 - alike) * draw.exponential(size=(100, 100)) for _ in range(2)]
    seen = [picture + draw.exponential(size=(100, 100)) for picture in wanted]
    return [grain(each.astype(np.float32)) for each in seen], [grain(each.astype(np.float32)) for each in wanted]


def pattern(number: int) -> Pattern:
    names = {"file": f"patterns/round-1/{number:04d}.png", "capture": f"captures/round-1/{number:04d}"}
    return Pattern(1, number, "hologram", 0, 1.0, "0" * 64, f"{number:064d}", target="f" * 64, **names)


PAIR = [pattern(1), pattern(2)]


def test_predictions_that_are_too_alike_are_said_to_be_and_not_guessed_at() -> None:
    seen, wanted = pictures(alike=0.999, seed=1)
    for photographs in (seen, seen[::-1]):
        faults, alike = check_swaps(PAIR, photographs, wanted)
        assert not faults
        assert alike == ["captures/round-1/0001 and captures/round-1/0002"]
    seen, wanted = pictures(alike=0.5)
    assert check_swaps(PAIR, seen, wanted) == ([], [])
    assert check_swaps(PAIR, seen[::-1], wanted)[0]


def test_no_alarm_without_a_trace_of_the_predictions_or_of_one_hologram_shown_twice() -> None:
    alarms = 0
    for seed in range(50):
        _, wanted = pictures(alike=0.5, seed=seed)
        seen, _ = pictures(alike=0.5, seed=seed + 1000)
        alarms += bool(check_swaps(PAIR, seen, wanted)[0])
    assert alarms == 0
    same = [PAIR[0], replace(PAIR[1], sha256=PAIR[0].sha256)]
    seen, wanted = pictures(alike=0.5)
    assert check_swaps(same, seen[::-1], wanted) == ([], [])


def test_three_photographs_that_moved_on_by_one_are_each_named() -> None:
    draw = np.random.default_rng(3)
    wanted = [grain(draw.exponential(size=(64, 64)).astype(np.float32)) for _ in range(3)]
    three = [*PAIR, pattern(3)]
    faults, _ = check_swaps(three, [wanted[1], wanted[2], wanted[0]], wanted)
    lines = [f"wrong order: captures/round-1/000{a} shows pattern 000{b}" for a, b in ((1, 2), (2, 3), (3, 1))]
    assert [line.split(",")[0] for line in faults] == lines


FAST = """\
name: fast
like: leto-mild
version: 1
description: leto-mild with a fast panel.
panel: {frames: 4, wavelengths: [5.17e-7]}
"""
FRAMES = (
    "{name: random_frames, label: four, params: {frames: 4, iterations: 5}}, "
    "{name: random_frames, label: one, params: {iterations: 5}}"
)


def psnr(report: Path) -> pd.Series:
    return pd.read_csv(report / "table.csv").set_index("label")["psnr_linear_db"]


def test_frames_are_photographed_once_and_score_as_on_the_display_itself(tmp_path: Path) -> None:
    (tmp_path / "fast.yaml").write_text(FAST)
    folder = exported(tmp_path, FRAMES, "fast.yaml", "--dark", 900, panel=128)
    rows = list(csv.DictReader((folder / "patterns" / "round-1" / "order.csv").read_text().splitlines()))
    several = [row for row in rows if " " in row["show"]]
    assert len(several) == 1
    first, *others = several[0]["show"].split()
    assert others == [first.replace(".png", f"-frame-{frame}.png") for frame in (2, 3, 4)]
    assert len({row["save_photograph_as"] for row in rows}) == len(rows)
    Lab(str(tmp_path / "fast.yaml"), (128, 128), seed=1).photograph_round(folder, 1)

    study = ("--study", tmp_path / "study.yaml")
    levels = cv2.imread(str(folder / others[0]), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(folder / others[0]), 255 - levels)
    assert f"{others[0]}: is not the pattern that was exported" in told("import", folder, *study)[1]
    cv2.imwrite(str(folder / others[0]), levels)

    succeed("session", "import", folder, *study)
    succeed("run", study[1], "--output", tmp_path / "direct", "--executor", "serial")
    ours, direct = psnr(folder / "report"), psnr(tmp_path / "direct")
    for label in ("four", "one"):
        assert ours[label] == pytest.approx(direct[label], abs=0.7)  # means over pixels, samples at points
    assert ours["four"] - ours["one"] == pytest.approx(direct["four"] - direct["one"], abs=0.4)
    assert ours["four"] > ours["one"] + 1
    records = pd.read_csv(folder / "report" / "records.csv").set_index("label")
    assert records.loc["four", ["frames", "captures"]].tolist() == [4, 0]
    (tmp_path / "fast.yaml").write_text(FAST)
    content = json.loads((folder / "manifest.json").read_text())
    shared = next(pattern for pattern in content["patterns"] if pattern["frames"])
    shared["frames"].reverse()
    (folder / "manifest.json").write_text(json.dumps(content))
    with pytest.raises(UserError, match=r"file 'patterns/round-1/\d+-frame-4.png' should be '.*-frame-2.png'"):
        read_manifest(folder)


def save(path: Path, picture: np.ndarray) -> None:
    """``(3, h, w)`` in [0, 1] with 16 bits."""
    path.parent.mkdir(parents=True, exist_ok=True)
    levels = (picture.clip(0, 1) * 65535).round().astype(np.uint16)
    assert cv2.imwrite(str(path), np.ascontiguousarray(levels[::-1].transpose(1, 2, 0)))


def lay_out(session: Path, folder: Path) -> None:
    """The photographs of a session and its targets as folders of pictures, linear light without dark level."""
    study, photographer = load_study(session / "study.yaml"), session_photographer(session)
    region = next(iter(displays(study).values())).spec.region
    for item in study.dataset.items():
        save(folder / "targets" / f"{item}.png", srgb_encode(study.dataset.load(item, region.shape)).numpy())
        shown = [pattern for pattern in read_manifest(session).patterns if pattern.target == digest(item)]
        light = np.stack([photographer.light(pattern) for pattern in sorted(shown, key=lambda each: each.colour)])
        save(folder / "captures" / "wirtinger" / f"{item}.png", light / light.max())


def test_import_and_score_give_the_same_number_for_the_same_photographs(tmp_path: Path) -> None:
    session, display = tmp_path / "bench", "{profiles: [leto-mild], panel: [208, 208]}"
    method, scores = "{name: wirtinger, params: {iterations: 20}}", "{metrics: [psnr, ssim]}"
    config = write_study(tmp_path / "study.yaml", method, display=display, protocol=scores)
    succeed("session", "export", config, session)
    Lab("leto-mild", (208, 208), seed=1).photograph_round(session, 1)
    succeed("session", "import", session)
    lay_out(session, tmp_path)
    pictures = ("--captures", tmp_path / "captures", "--targets", tmp_path / "targets")
    succeed("score", *pictures, "--output", tmp_path / "scored", "--values", "linear")
    imported, scored = (
        pd.read_csv(folder / "table.csv").set_index("label").loc["wirtinger"]
        for folder in (session / "report", tmp_path / "scored")
    )
    assert imported["psnr_linear_db"] == pytest.approx(scored["psnr_linear_db"], abs=0.1)
    assert imported["ssim_linear"] == pytest.approx(scored["ssim_linear"], abs=0.01)
