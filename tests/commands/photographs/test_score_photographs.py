"""``holoeval score`` on photographs as laboratories have them: one laser, too dark, cut off, speckled, aligned."""

import io
import re
import shutil
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
import pytest
import torch
from PIL import Image, ImageCms
from rich.console import Console

from holobench_eval.commands.score import score_folders
from holobench_eval.core.errors import UserError
from holobench_eval.metrics import score
from holobench_eval.optics.colour import srgb_decode, srgb_encode
from holobench_eval.study.folders import scoring as scored_pictures
from tests.support.bayer import bayer_dng
from tests.support.photographed import captured, drowned, few, photograph, pose, save, unclipped
from tests.support.reports import whole

SHAPE = (160, 200)
KEY = "psnr_stored_db"
# The brightness of three lasers: equal channels would be a gray picture, which has no score against one in colour.
LASERS = np.array([1.0, 0.9, 0.8], np.float32)[:, None, None]


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Only the two metrics that are quick, and one aligner."""
    monkeypatch.setattr(scored_pictures, "score", few)
    monkeypatch.setattr(scored_pictures, "second_warp", lambda _frame, _reference, first: first)


def run(root: Path, values: str = "stored", **options: Any) -> tuple[str, str, pd.DataFrame]:
    """The whole report, what the terminal shows, and the records of captures by method and target."""
    console = Console(file=io.StringIO(), width=200)
    report, _ = score_folders(root / "captures", root / "targets", root / "out", values, None, None, console, **options)
    records = pd.read_csv(root / "out" / "records.csv").set_index(["label", "target"])
    return whole(report), console.file.getvalue(), records[records["category"] == "given"]


def test_raw_files_are_linear_light_alone(tmp_path):
    pytest.importorskip("rawpy")
    save(tmp_path / "targets" / "astronaut.png", photograph("astronaut", SHAPE)[:1])
    (tmp_path / "captures" / "m").mkdir(parents=True)
    (tmp_path / "captures" / "m" / "astronaut.dng").write_bytes(bayer_dng(np.full((320, 400), 5000, np.uint16)))
    with pytest.raises(UserError, match="RAW files and floating point hold linear light; expected --values linear"):
        run(tmp_path)


def cut_off(root: Path, **lacking: int) -> Path:
    """Captures of a target, each without so many pixels of it on the left."""
    target = photograph("astronaut", SHAPE)
    save(root / "targets" / "astronaut.png", target)
    for method, pixels in lacking.items():
        where = np.array([[1.5, 0, 30 - 1.5 * pixels], [0, 1.5, 25], [0, 0, 1]])
        capture = captured(target, where, (300, 400), np.random.default_rng(3), contrast=0.3)
        save(root / "captures" / method / "astronaut.png", capture[:, :, 30 * (pixels > 0) :])
    return root


def test_a_cut_capture_names_the_side_and_with_visible_its_part_is_scored_and_its_share_is_told(tmp_path):
    root = cut_off(tmp_path, whole=0, cut=40)
    text, _, records = run(root)
    assert records["state"].droplevel("target").to_dict() == {"cut": "failed", "whole": "done"}
    assert "40 of its pixels on the left side" in text
    entire = records.loc[("whole", "astronaut"), KEY]
    text, terminal, records = run(root, visible=True)
    assert (records["state"] == "done").all()
    shares = records.droplevel("target")[["share_seen", "share_scored"]]
    assert shares.loc["whole", "share_seen"] == 1
    assert shares.loc["cut", "share_seen"] == pytest.approx(0.8, abs=0.01)
    assert shares["share_scored"].to_list() == pytest.approx([0.8] * 2, abs=0.01)
    assert "Seen of it: cut 79." in terminal
    # Both are scored on the same pixels, and the same photograph with the same speckle has nearly the same score.
    found = records[KEY].droplevel("target")
    assert found["cut"] == pytest.approx(found["whole"], abs=1.0)
    assert found["whole"] != entire


def test_visible_changes_no_score_of_captures_that_show_all(tmp_path):
    root = cut_off(tmp_path, a=0, b=0)
    (_, said, before), (_, _, after) = run(root), run(root, visible=True)
    assert said.startswith("--values stored: ")
    assert after[KEY].to_dict() == before[KEY].to_dict()
    assert (after["share_scored"] == 1).all()


def test_captures_that_have_little_of_their_target_in_common_are_refused_with_the_share_of_each(tmp_path):
    target = photograph("astronaut", SHAPE)
    save(tmp_path / "targets" / "astronaut.png", target)
    capture = captured(target, np.diag([1.5, 1.5, 1]), (240, 300), np.random.default_rng(3), contrast=0.2)
    save(tmp_path / "captures" / "left" / "astronaut.png", capture[:, :, :205])
    save(tmp_path / "captures" / "right" / "astronaut.png", capture[:, :, 95:])
    text, _, records = run(tmp_path, visible=True)
    assert (records["state"] == "failed").all()
    said = r"have 3\d% of it in common \(left 6\d%, right 6\d%\), and 50% is needed"
    assert records["reason"].str.contains(said).all()
    assert "in common" in text


def test_aligned_captures_are_scored_as_they_are_however_speckled(tmp_path):
    target = photograph("astronaut", SHAPE)
    save(tmp_path / "targets" / "astronaut.png", target)
    capture = drowned(target, np.eye(3), SHAPE, np.random.default_rng(3)) * LASERS
    save(tmp_path / "captures" / "speckled" / "astronaut.png", capture)
    save(tmp_path / "captures" / "larger" / "astronaut.png", np.pad(capture, ((0, 0), (1, 1), (0, 0))))
    text, _, records = run(tmp_path)
    assert (records["state"] == "failed").all()
    text, _, records = run(tmp_path, aligned=True)
    assert records["state"].droplevel("target").to_dict() == {"larger": "failed", "speckled": "done"}
    assert "aligned captures have the size of their target" in text
    levels = np.round(capture * 255).astype(np.float32) / 255
    expected = score(levels, np.round(target * 255) / 255, metrics=("psnr",), stored=True, refine=False, blur=())
    assert records.loc[("speckled", "astronaut"), KEY] == pytest.approx(expected["psnr_stored"], abs=1e-3)
    with pytest.raises(UserError, match="expected one of the two"):
        run(tmp_path, visible=True, aligned=True)


def test_a_baseline_that_is_not_found_by_itself_is_scored_in_the_pose_of_its_session(tmp_path):
    where, size = pose(np.random.default_rng(1), SHAPE, scale=1.3)
    for name in ("astronaut", "coffee"):
        target = photograph(name, SHAPE)
        save(tmp_path / "targets" / f"{name}.png", target)
        draw = np.random.default_rng(5)
        save(tmp_path / "captures" / "good" / f"{name}.png", captured(target, where, size, draw, contrast=0.2))
        save(tmp_path / "captures" / "baseline" / f"{name}.png", drowned(target, where, size, draw) * LASERS)
    text, _, records = run(tmp_path)
    assert (records["state"] == "done").all()
    assert "for one that is not found by itself" in text
    assert (records.loc["good", KEY] > records.loc["baseline", KEY] + 2).all()
    shutil.rmtree(tmp_path / "captures" / "good")
    _, _, alone = run(tmp_path)
    assert (alone["state"] == "failed").all()


def test_a_target_that_no_capture_shows_has_no_floor_and_alone_it_makes_a_report_of_reasons(tmp_path):
    for name, seen in (("astronaut", "astronaut"), ("coffee", "rocket")):
        save(tmp_path / "targets" / f"{name}.png", photograph(name, SHAPE))
        save(tmp_path / "captures" / "m" / f"{name}.png", np.pad(photograph(seen, SHAPE), ((0, 0), (20, 20), (20, 20))))
    text, _, records = run(tmp_path)
    assert records["state"].to_dict() == {("m", "astronaut"): "done", ("m", "coffee"): "failed"}
    everything = pd.read_csv(tmp_path / "out" / "records.csv")
    assert set(everything.loc[everything["category"] == "floor", "target"]) == {"astronaut"}
    for place in ("targets", "captures/m"):
        (tmp_path / place / "astronaut.png").unlink()
    text, _, records = run(tmp_path)
    assert "the target is not found in the capture" in text
    assert list(pd.read_csv(tmp_path / "out" / "records.csv")["category"]) == ["given"]


def test_captures_that_are_mirrored_clipped_or_nearly_the_target_are_named_and_the_target_itself_is_refused(tmp_path):
    target = photograph("astronaut", SHAPE)
    for method, shown, gain in (("fair", target, 0.9), ("clipped", target, 2), ("mirrored", target[..., ::-1], 1)):
        draw = np.random.default_rng(5)
        where, size = pose(draw, SHAPE, scale=1.3)
        capture = captured(np.ascontiguousarray(shown), where, size, draw, contrast=0.2)
        capture = unclipped(capture, draw) if method == "fair" else np.clip(gain * capture, 0, 1)
        save(tmp_path / "captures" / method / "astronaut.png", capture)
    for folder in ("targets", "captures/itself"):
        save(tmp_path / folder / "astronaut.png", target)
    save(tmp_path / "captures" / "padded" / "astronaut.png", np.pad(target, ((0, 0), (20, 20), (30, 30))))
    text, terminal, records = run(tmp_path)
    assert (records.drop("itself")["state"] == "done").all()
    itself, share = records.loc[("itself", "astronaut")], records.loc[("clipped", "astronaut"), "saturated"]
    assert itself["state"] == "failed"
    assert "is the target itself, value for value" in itself["reason"]
    assert share > 0.05
    for said in (text, terminal):
        assert "is not: padded/astronaut." in said
        assert "so: mirrored/astronaut." in said
        assert f"clipped/astronaut {share:.2%}" in said
    assert "fair/" not in terminal


def linear_counts(root: Path, black: int) -> None:
    """Captures of one target on a black level of 65535 counts: "bright" is worse than "dim", which has less light."""
    target, draw = photograph("astronaut", SHAPE).mean(axis=0, keepdims=True), np.random.default_rng(4)
    save(root / "targets" / "astronaut.png", target)
    light = srgb_decode(torch.from_numpy(np.round(target * 255) / 255)).numpy()
    for method, gain, contrast in (("bright", 0.6, 0.30), ("dim", 0.12, 0.20)):
        seen = 65535 * gain * light * (1 + contrast * draw.standard_normal(light.shape)).clip(0, 1.4)
        path = root / "captures" / method / "astronaut.tif"
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), np.clip(seen[0] + black + 40 * draw.standard_normal(SHAPE), 0, 65535).astype(np.uint16))


def test_a_black_level_that_turns_the_order_is_told_and_dark_takes_it_off(tmp_path):
    for root, black in ((tmp_path / "none", 0), (tmp_path / "black", 4096)):
        linear_counts(root, black)
    key = "psnr_linear_db"
    right = run(tmp_path / "none", "linear", aligned=True)
    wrong = run(tmp_path / "black", "linear", aligned=True)
    text, terminal, taken = run(tmp_path / "black", "linear", aligned=True, dark="4096")
    true, lifted, off = (records[key].droplevel("target") for records in (right[2], wrong[2], taken))
    assert true["dim"] > true["bright"] + 1
    assert lifted["dim"] < lifted["bright"]
    assert off["dim"] == pytest.approx(true["dim"], abs=0.1)
    assert off["bright"] == pytest.approx(true["bright"], abs=0.1)
    assert "Bright where the target is darkest, by more than 5% of its white: dim/astronaut" in wrong[1]
    assert "Bright where" not in right[1] + terminal
    assert "Darker than" not in text + wrong[0]
    for dark, said in (("4", "although --dark took 4 counts off: dim/astronaut"), ("4800", "Darker than the target")):
        assert said in run(tmp_path / "black", "linear", aligned=True, dark=dark)[1]
    with pytest.raises(UserError, match="not off encoded values; expected --values linear"):
        run(tmp_path / "black", "srgb", dark="4096")
    for path in (tmp_path / "none" / "captures").glob("*/*.tif"):  # too much was taken off by other software
        counts = cv2.imread(str(path), cv2.IMREAD_UNCHANGED).astype(np.float32)
        np.save(path.with_suffix(".npy"), counts / 65535 - 0.05)
        path.unlink()
    assert "Darker than the target where it is darkest" in run(tmp_path / "none", "linear", aligned=True)[1]


@pytest.mark.parametrize(("values", "coarse"), [("stored", 1), ("linear", 16)])
def test_a_black_level_is_told_whatever_the_values_and_with_what_takes_it_off(tmp_path, values, coarse):
    linear_counts(tmp_path, 4096)
    for path in tmp_path.glob("captures/*/*.tif"):
        counts = cv2.imread(str(path), -1)
        if values == "linear":
            cv2.imwrite(str(path), counts // coarse * coarse)
            continue
        encoded = srgb_encode(torch.from_numpy(counts / counts.max())).numpy()
        cv2.imwrite(str(path.with_suffix(".png")), np.round(255 * encoded).astype(np.uint8))
        path.unlink()
    dark = "256" if values == "linear" else None
    for said in run(tmp_path, values, aligned=True, dark=dark)[:2]:
        assert "Bright where the target is darkest" in said
        assert ("save linear counts and take it off with --dark" in said) == (values != "linear")
        assert ("256 counts off (the files count in steps of 16: is it 4096?)" in said) == (values == "linear")


def test_a_clipped_capture_of_linear_light_is_refused_as_in_a_study_though_dark_counts_are_taken_off(tmp_path):
    linear_counts(tmp_path, 4096)
    path = tmp_path / "captures" / "bright" / "astronaut.tif"
    cv2.imwrite(str(path), np.minimum(cv2.imread(str(path), -1).astype(int) * 3, 65535).astype(np.uint16))
    records = run(tmp_path, "linear", aligned=True, dark="4096")[2].droplevel("target")
    assert records.loc["bright", "state"] == "failed"
    assert "of the scored samples are clipped, more than 0.1%" in records.loc["bright", "reason"]
    assert records.loc["dim", "state"] == "done"


def test_aligned_captures_that_are_not_alike_are_named_with_their_correlation(tmp_path):
    save(tmp_path / "targets" / "astronaut.png", photograph("astronaut", SHAPE))
    for method, shown in (("right", "astronaut"), ("wrong", "coffee")):
        seen = captured(photograph(shown, SHAPE), np.eye(3), SHAPE, np.random.default_rng(3), contrast=0.3)
        save(tmp_path / "captures" / method / "astronaut.png", 0.9 * seen)
    text, terminal, records = run(tmp_path, aligned=True)
    assert (records["state"] == "done").all()
    for told in (text, terminal):
        assert "Not alike pixel to pixel, with correlations below 0.25: wrong/astronaut" in told
    assert "right/" not in terminal.partition("Not alike")[2].partition("\n")[0]


@pytest.mark.parametrize(("values", "place"), [("stored", "targets"), ("srgb", "captures/m"), ("linear", "captures/m")])
def test_red_and_blue_that_changed_places_have_no_score_but_a_reason(tmp_path, place, values):
    target = photograph("astronaut", SHAPE)
    save(tmp_path / "targets" / "astronaut.png", target)
    draw = np.random.default_rng(3)
    seen = unclipped(captured(target, np.eye(3), SHAPE, draw, contrast=0.5), draw) * LASERS
    save(tmp_path / "captures" / "m" / "astronaut.png", seen)
    assert (run(tmp_path, values, aligned=True)[2]["state"] == "done").all()
    for path in (tmp_path / place).iterdir():
        cv2.imwrite(str(path), cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB))
    records = run(tmp_path, values, aligned=True)[2]
    assert (records["state"] == "failed").all()
    assert records["reason"].str.contains("red and blue are exchanged in the capture or in its target").all()


LIGHT = srgb_decode(torch.from_numpy(photograph("astronaut", (64, 80))[:1])).numpy()[0]


def counts(root: Path, name: str, light: np.ndarray, method: str = "m") -> Path:
    """A capture as 16-bit counts."""
    path = root / "captures" / method / name
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.round(light * 65535).clip(0, 65535).astype(np.uint16))
    return path


def looped(path: Path) -> None:
    path.unlink()
    path.symlink_to(path.name)


BAD = {  # what is wrong with one capture of a folder, and what the hole says
    "a link to itself": (looped, "a link that leads to no file"),
    "damaged": (lambda path: path.write_bytes(path.read_bytes()[:300]), "truncated or damaged"),
    "another size": (
        lambda path: cv2.imwrite(str(path), np.arange(4800, dtype=np.uint16).reshape(60, 80)),
        "aligned captures have the size",
    ),
    "compressed with loss": (lambda path: path.write_bytes(cv2.imencode(".jpg", 255 * LIGHT)[1]), "no linear light"),
    "of another colour space": (
        lambda path: Image.fromarray((255 * LIGHT).astype(np.uint8)).save(
            path, icc_profile=ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")).tobytes()
        ),
        "its ICC colour profile is",
    ),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two methods on six targets, the captures of which are of light."""
    root = tmp_path_factory.mktemp("folder")
    for index in range(6):
        target = np.ascontiguousarray(photograph("coffee", (128, 160))[:1, 10 * index :, :][:, :64, :80])
        save(root / "targets" / f"t{index}.png", target)
        light = srgb_decode(torch.from_numpy(np.round(target * 255) / 255)).numpy()[0]
        for method, contrast in (("a", 0.1), ("b", 0.2)):
            noise = np.random.default_rng(index).standard_normal(light.shape)
            counts(root, f"t{index}.png", 0.5 * light * (1 + contrast * noise).clip(0), method)
    return root


@pytest.mark.parametrize("what", BAD)
def test_one_bad_capture_is_a_hole_with_its_reason_and_the_others_are_compared(tmp_path, folder, what):
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    spoil, said = BAD[what]
    spoil(tmp_path / "captures" / "a" / "t2.png")
    text, _, records = run(tmp_path, "linear", aligned=True)
    assert records["state"].value_counts().to_dict() == {"done": 11, "failed": 1}
    assert said in records.loc[("a", "t2"), "reason"]
    assert re.search(r"Against b, on the targets that both have: a \+[4-7]\.\d\d dB \[.*\] on 5 of 6", text)


def test_all_bad_files_of_a_folder_are_told_at_once(tmp_path, folder):
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    for path in tmp_path.glob("captures/a/*"):
        path.write_bytes(b"")
    terminal = run(tmp_path, "linear", aligned=True)[2]["reason"].droplevel("label")
    assert terminal.str.contains("not an image").sum() == 6
    for path in tmp_path.glob("captures/b/*"):
        path.write_bytes(b"")
    with pytest.raises(UserError) as told:
        run(tmp_path, "linear", aligned=True)
    assert str(told.value).count(": not an image") == 12
    for name in ("t1", "t3"):
        (tmp_path / "targets" / f"{name}.png").write_bytes(b"")
    (tmp_path / "targets" / "t5.png").unlink()
    with pytest.raises(UserError) as told:
        run(tmp_path, "linear", aligned=True)
    faults = (": not an image", "t5.png: no target of this name")
    assert [str(told.value).count(fault) for fault in faults] == [14, 2]


@pytest.mark.parametrize("value", [1e300, -1e300, 1e-300, 1e38])
@pytest.mark.filterwarnings("error")
def test_numbers_that_no_camera_counts_are_refused_without_a_raw_warning(tmp_path, value):
    save(tmp_path / "targets" / "t.png", photograph("astronaut", (64, 80))[:1])
    (tmp_path / "captures" / "m").mkdir(parents=True)
    scale = 1e-300 if abs(value) < 1 else 1.0
    light = LIGHT.astype(np.float64)
    np.save(tmp_path / "captures" / "m" / "t.npy", np.where(light < light.max(), scale * light, value))
    with pytest.raises(UserError, match=r"values from .* to .*, which no camera counts"):
        run(tmp_path, "linear", aligned=True)


def test_hot_pixels_are_told_with_the_score_without_them_and_never_called_over_exposed(tmp_path):
    target = (np.round(photograph("astronaut", (64, 80))[:1] * 255) / 255).astype(np.float32)
    save(tmp_path / "targets" / "t.png", target)
    light = srgb_decode(torch.from_numpy(target)).numpy()[0]
    seen = 0.1 * light * (1 + 0.1 * np.random.default_rng(1).standard_normal(light.shape))
    for method, every, level in (("good", 10**9, 0), ("hot", 2500, 0.9), ("full", 500, 1.0)):
        counts(
            tmp_path, "t.png", np.where(np.arange(light.size).reshape(light.shape) % every == 7, level, seen), method
        )
    _, terminal, records = run(tmp_path, "linear", aligned=True)
    records = records.droplevel("target")
    assert records["state"].to_dict() == {"good": "done", "hot": "done", "full": "failed"}
    assert "stand alone, as hot pixels do; have the camera's software replace them" in records.loc["full", "reason"]
    assert "over-exposed" not in records.loc["full", "reason"]
    assert records.loc["hot", "psnr_linear_mended_db"] == pytest.approx(records.loc["good", "psnr_linear_db"], abs=0.3)
    assert records.loc["hot", "psnr_linear_db"] < records.loc["good", "psnr_linear_db"] - 2
    assert re.search(
        r"PSNR without them, and how many: hot/t \d\d\.\d\d dB for .*\(6\)\. To take hot ones off, give a dark frame",
        terminal,
    )
    assert "good/t" not in terminal
    counts(tmp_path, "t.png", np.minimum(9 * seen, 0.61), "good")
    reason = run(tmp_path, "linear", aligned=True)[2].loc[("good", "t"), "reason"]
    assert "the capture is over-exposed" in reason
