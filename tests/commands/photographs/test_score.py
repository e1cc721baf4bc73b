"""``holoeval score``: pictures in, the report of a study out, and one clear line for everything that is wrong."""

import io
import json
import re
import shutil
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
import typer
from PIL import Image
from rich.console import Console

from holobench_eval.commands.score import score as command
from holobench_eval.commands.score import score_folders
from holobench_eval.core.errors import UserError
from holobench_eval.imaging.align import Alignment
from holobench_eval.report import read_records
from holobench_eval.study.folders import scoring as scored_pictures
from holobench_eval.study.folders.files import read_folders
from tests.support.photographed import captured, few, photograph, pose, save
from tests.support.reports import whole

REAL = Path(__file__).resolve().parents[3] / "../shared/captures/stanford-2021"
PUBLISHED = {"sgd-asm": 20.94, "citl-asm": 25.16, "sgd-ours": 27.41}
SHAPE = (160, 200)
SPECKLE = {"clean": 0.2, "coarse": 0.6}


def lay_out(root: Path) -> Path:
    """Two methods, two targets, one pose."""
    where, size = pose(np.random.default_rng(1), SHAPE, scale=1.3, turns=1, mirrored=True)
    for name in ("astronaut", "coffee"):
        target = photograph(name, SHAPE)
        save(root / "targets" / f"{name}.png", target)
        for index, (method, contrast) in enumerate(SPECKLE.items()):
            draw = np.random.default_rng(index)
            save(root / "captures" / method / f"{name}.png", captured(target, where, size, draw, contrast=contrast))
    return root


def run(root: Path, values: str = "stored", baseline: str | None = None) -> str:
    report, _ = score_folders(root / "captures", root / "targets", root / "out", values, baseline, None, quiet())
    return whole(report)


def records(root: Path) -> list[Path]:
    """The files of records, those of alignments left out."""
    return sorted(path for path in (root / "out" / "records").glob("*.json") if not path.name.startswith("alignment"))


def table(root: Path) -> pd.DataFrame:
    """The records by method and target."""
    return pd.read_csv(root / "out" / "records.csv").set_index(["label", "target"])


def quiet() -> Console:
    return Console(file=io.StringIO())


@pytest.fixture(scope="module")
def scored(tmp_path_factory):
    root = lay_out(tmp_path_factory.mktemp("pictures"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scored_pictures, "score", few)
        text = run(root, baseline="coarse")
    return root, text


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(scored_pictures, "score", few)
    monkeypatch.setattr(scored_pictures, "second_warp", lambda _frame, _reference, first: first)


@pytest.fixture
def pictures(scored, tmp_path):
    """A copy of the scored folders, to be spoilt."""
    shutil.copytree(scored[0], tmp_path / "copy")
    return tmp_path / "copy"


def test_the_report_says_where_the_geometry_came_from_and_has_no_word_of_displays_that_were_not_there(scored):
    root, text = scored
    for said in ("not from fiducials", "One shared alignment for 4 captures", "## Alignment", "## Paired tests"):
        assert said in text
    words = ("simulated", "panel", "profile", "Seconds", "Holograms of a circle grid", "yaml", "phase pattern")
    assert not [word for word in (*words, "linear light [dB]") if word in text]  # values are as they are stored
    for method in SPECKLE:
        for name in ("astronaut", "coffee"):
            file = root / "out" / "figures" / f"alignment-{method}-{name}.jpg"
            assert f"figures/{file.name}" in text
            assert cv2.imread(str(file)) is not None


def test_the_cleaner_pictures_score_higher_and_the_tables_say_that_they_are_of_given_pictures(scored):
    rows = pd.read_csv(scored[0] / "out" / "table.csv", index_col="label")
    assert rows.loc["clean", "psnr_stored_db"] > rows.loc["coarse", "psnr_stored_db"] + 1
    assert rows.loc["clean", "n"] == 2
    assert not any("linear" in column for column in rows)
    text = (scored[0] / "out" / "records.csv").read_text()
    cells = pd.read_csv(io.StringIO(text))
    assert (set(cells["study"]), set(cells["measure"])) == ({"out"}, {"files"})
    assert (cells["display"] == cells["condition"]).all()
    assert (read_records(text)["display_version"] == "").all()  # nobody knows the display


def test_a_second_run_computes_nothing_and_says_the_same(scored, monkeypatch):
    root, text = scored

    def never(*_: object, **__: object) -> None:
        raise AssertionError("computed again")

    for name in ("align", "score", "second_warp"):
        monkeypatch.setattr(scored_pictures, name, never)
    before = (root / "out" / "records.csv").read_bytes()
    assert run(root, baseline="coarse") == text
    assert (root / "out" / "records.csv").read_bytes() == before


def test_an_interrupted_run_goes_on(pictures, monkeypatch, quick):
    kept = records(pictures)
    kept[0].unlink()
    monkeypatch.setattr(scored_pictures, "align", None)
    assert "None: every planned cell has a score." in run(pictures, baseline="coarse")
    assert kept[0].is_file()


def test_a_changed_capture_is_scored_anew(pictures, quick):
    path = pictures / "captures" / "coarse" / "coffee.png"
    before = table(pictures)["psnr_stored_db"]
    Image.open(path).convert("L").convert("RGB").save(path)
    run(pictures)
    after = table(pictures)["psnr_stored_db"]
    assert after["coarse", "coffee"] != before["coarse", "coffee"]
    assert after["clean", "astronaut"] == pytest.approx(before["clean", "astronaut"], abs=0.5)


def test_a_capture_of_another_picture_and_a_lacking_one_are_holes_that_are_told(pictures, quick, capsys):
    captures = pictures / "captures"
    shutil.copy(captures / "clean" / "coffee.png", captures / "coarse" / "astronaut.png")
    (captures / "clean" / "astronaut.png").unlink()
    with pytest.raises(typer.Exit) as left:
        command(captures, pictures / "targets", pictures / "out")
    assert left.value.exit_code == 1
    assert "no capture of 'astronaut' in the folder of clean" in capsys.readouterr().out
    text = whole(pictures / "out" / "report.md")
    assert "the target is not found in the capture" in text
    assert "is the same picture as" in text
    cells = table(pictures)
    holes = cells[cells["state"] != "done"]
    assert sorted(holes["state"]) == ["failed", "missing"]
    assert holes["psnr_stored_db"].isna().all()


def test_gray_and_colour_do_not_mix_and_gray_alone_is_scored(pictures, quick):
    for path in [*(pictures / "captures" / "clean").iterdir(), pictures / "targets" / "astronaut.png"]:
        Image.open(path).convert("L").save(path)
    text = run(pictures)
    assert "the capture is gray and the target is in colour" in text
    assert "the capture is in colour and the target gray" in text
    assert "scale_0" in (pictures / "out" / "table.csv").read_text()
    assert table(pictures)["state"]["clean", "astronaut"] == "done"


@pytest.mark.parametrize(("values", "key"), [("srgb", "psnr_linear"), ("linear", "psnr_amplitude")])
def test_values_may_be_light_as_well(pictures, quick, values, key):
    shutil.rmtree(pictures / "captures" / "coarse")
    for path in (pictures / "captures").glob("*/*.png"):  # clipped ones would have no score in linear light
        levels, draw = np.array(Image.open(path)), np.random.default_rng(0)
        Image.fromarray(np.where(levels < 230, levels, draw.integers(180, 230, levels.shape)).astype(np.uint8)).save(
            path
        )
    text = run(pictures, values=values)
    assert key in (pictures / "out" / "table.csv").read_text()
    assert "None: every planned cell has a score." in text


def test_two_aligners_that_differ_are_told(pictures, monkeypatch, quick):
    def elsewhere(_frame, _reference, first):
        shift = np.array([[1, 0, 3.0], [0, 1, 0], [0, 0, 1]])
        return Alignment.from_dict(
            {"shape": first.shape, "homography": first.homography @ shift, "correlation": 1}
        ).warp

    shutil.rmtree(pictures / "out")
    monkeypatch.setattr(scored_pictures, "second_warp", elsewhere)
    text = run(pictures)
    assert "Warning: a second aligner" in text
    assert re.search(r"second aligner finds the target elsewhere.*: clean/astronaut \d+\.\d\d dB for \d+\.\d\d", text)


def outside(path: Path) -> None:
    path.rename(path.parents[3] / "outside.png")
    path.symlink_to(path.parents[3] / "outside.png")


def deeper(path: Path) -> None:
    (path.parent / "deeper").mkdir()
    path.rename(path.parent / "deeper" / path.name)


def target(path: Path) -> Path:
    return path.parents[2] / "targets" / "coffee.png"


@pytest.mark.parametrize(
    ("spoil", "line"),
    [
        (outside, "leads out of the folder"),
        (lambda path: shutil.copy(path, path.with_suffix(".tif")), "another picture named 'coffee'"),
        (lambda path: path.write_bytes(b""), "not an image"),
        (lambda path: path.rename(path.with_name("coffe.png")), "did you mean 'coffee'"),
        (lambda path: path.rename(path.with_name("coffee.png.png")), r"m/coffee.png.png; rename it coffee.png$"),
        (lambda path: target(path).rename(f"{target(path)}.png"), r"targets/coffee.png.png; rename it coffee.png$"),
        (lambda path: Image.new("RGB", (8, 8)).save(path), "8 x 8 pixels"),
        (lambda path: shutil.rmtree(path.parent), "no folders in it"),
        (deeper, "expected .*, or --captures .*m for those in its folder deeper$"),
        (lambda path: path.rename(path.parents[1] / "loose.png"), "outside a method's folder"),
        (lambda path: shutil.rmtree(target(path).parent), "no such folder"),
        (lambda path: Image.new("RGB", (64, 48)).save(target(path)), "coffee.png: black; expected a target with light"),
    ],
)
def test_bad_input_is_one_line(tmp_path, spoil, line):
    small = photograph("coffee", (48, 64))
    path = tmp_path / "bench" / "captures" / "m" / "coffee.png"
    save(path, small)
    save(tmp_path / "bench" / "targets" / "coffee.png", small)
    spoil(path)
    with pytest.raises(UserError, match=line) as error:
        read_folders(tmp_path / "bench" / "captures", tmp_path / "bench" / "targets")
    assert "\n" not in str(error.value)
    assert "expected" in str(error.value) or "allowed" in str(error.value) or ";" in str(error.value)


def test_what_is_suspicious_is_noted(tmp_path):
    small = photograph("coffee", (48, 64))
    for place in ("captures/a/coffee.png", "captures/b/coffee.jpg", "targets/coffee.png", "targets/unseen.png"):
        save(tmp_path / place, small if "unseen" not in place else small[:, ::-1])
    found = read_folders(tmp_path / "captures", tmp_path / "targets")
    notes = " ".join(found.notes)
    assert "not linear in light: coffee.jpg" in notes
    assert "the capture is the target itself" in found.pairings["a", "coffee"].refused
    assert found.pairings["b", "coffee"].refused == ""
    assert "Without any capture: unseen" in notes


def test_wrong_choices_are_named(scored):
    root = scored[0]
    for options, line in (({"values": "gamma"}, "allowed: linear, srgb"), ({"baseline": "cleen"}, "you mean 'clean'")):
        with pytest.raises(UserError, match=line):
            run(root, **options)
    with pytest.raises(UserError, match="would mix with"):
        score_folders(root / "captures", root / "targets", root / "captures" / "out", "stored", None, None, quiet())


@pytest.mark.skipif(not REAL.is_dir(), reason="the real captures are not here")
def test_three_published_captures_keep_their_order_and_their_scores(tmp_path, monkeypatch):
    def fast(*pictures, **options):
        return few(*pictures, **{**options, "refine": False, "blur": ()})

    monkeypatch.setattr(scored_pictures, "score", fast)
    for name in PUBLISHED:
        (tmp_path / "captures" / name).mkdir(parents=True)
        shutil.copy(REAL / f"{name}.png", tmp_path / "captures" / name / "target.png")
    (tmp_path / "targets").mkdir()
    shutil.copy(REAL / "target.png", tmp_path / "targets" / "target.png")
    text = run(tmp_path, baseline="sgd-asm")
    assert "An alignment of its own for 3 captures" in text  # a third of a capture pixel apart
    assert "agrees within 0.2 dB on 3 captures" in text
    found = pd.read_csv(tmp_path / "out" / "table.csv", index_col="label")["psnr_stored_db"][list(PUBLISHED)].to_dict()
    assert found == pytest.approx(PUBLISHED, abs=0.3)
    assert sorted(found, key=found.__getitem__) == list(PUBLISHED)
    cells = [json.loads(path.read_text())["capture"] for path in records(tmp_path)]
    own = [Alignment.from_dict(cell["geometry"]).warp.corners() for cell in cells if cell["geometry"]["kind"] == "own"]
    crop = 1.2 * (np.array([[0, 0], [799, 0], [0, 799], [799, 799]]) + 0.5) - 0.5 + [360, 0]
    assert len(own) == 3
    assert np.linalg.norm(own - crop, axis=2).max() < 1  # capture pixels, at a corner
    assert np.linalg.norm(np.mean(own, axis=0) - crop, axis=1).max() < 0.5
