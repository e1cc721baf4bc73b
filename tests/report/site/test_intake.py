"""What a folder of others has to be, and that whatever else is refused in one line that says what to do."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from PIL import Image

from holobench_eval.core.errors import UserError
from holobench_eval.report.site import intake, pictures, write_site
from holobench_eval.report.site.intake import read
from tests.support.results_folder import edited, write_results

OWN = Path("reports")


def refused(folder: Path, *words: str) -> None:
    with pytest.raises(UserError) as error:
        write_site([folder], folder.parent / "site", OWN)
    text = str(error.value)
    assert "\n" not in text
    for word in words:
        assert word in text
    assert not (folder.parent / "site").exists()


def told(folder: Path, **changes: Any) -> None:
    """Change the provenance of a folder; None takes a key out."""
    path = folder / "provenance.json"
    known = json.loads(path.read_text()) | changes
    path.write_text(json.dumps({key: value for key, value in known.items() if value is not None}))


def pretending(folder: Path) -> None:
    """No word of whose it is, and a report as own folders have it."""
    told(folder, by=None)
    (folder / "report.md").write_text("# Mine")


def test_a_folder_of_others_is_taken_in_with_its_thumbnails(handed_in: Path) -> None:
    (handed_in / "tests.csv").unlink()
    assert write_site([handed_in], handed_in.parent / "site", OWN) == (1, [])
    page = (handed_in.parent / "site" / "methods" / "hil.html").read_text()
    assert "Their lab" in page
    assert page.count("<figure>") == 2


def test_a_network_without_photographs_stays_a_network(handed_in: Path) -> None:
    frame = pd.read_csv(handed_in / "records.csv", dtype=str, keep_default_na=False)
    assert set(frame.loc[frame["label"] == "Wirtinger", "category"]) == {"open loop"}
    frame["learned_sha256"] = frame["label"].map({"Wirtinger": "2" * 64}).fillna("")
    frame.to_csv(handed_in / "records.csv", index=False)
    layout = read(handed_in, OWN).results.layout
    assert "Wirtinger" in layout.trained
    assert layout.category("Wirtinger") == "open loop"


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("psnr_linear_db", "inf", ("psnr_linear_db inf", "expected a number from -200 to 80")),
        ("psnr_linear_db", "nan", ("psnr_linear_db nan", "expected a number from")),
        ("psnr_linear_db", "much", ("psnr_linear_db", "much")),
        ("ssim_linear", "1.5", ("ssim_linear 1.5", "to 1")),
        ("captures", "-1", ("captures -1", "from 0 to 1e+09")),
        ("state", "won", ("state 'won'", "done, failed")),
        ("state", "failed", ("is not done and has a score",)),
        ("category", "best", ("category 'best'", "open loop")),
        ("measure", "beauty", ("measure 'beauty'", "picture")),
        ("measure", "focus", ("one study a folder",)),
        ("exposure", "bright", ("exposure 'bright'", "equal")),
        ("label", "x" * 400, ("a name of 400 characters", "at most 300")),
        ("display", "nobody's", ("no digest of the display", "nobody's")),
        ("display", "no\nbody", ("display 'no\\nbody'", "cannot be seen")),
        ("label", "\u202eevil", ("label '\\u202eevil'", "cannot be seen")),
        ("label", "hil", ("differs by case or space alone from",)),
        ("target", "Astro\u200bnaut", ("target", "cannot be seen")),
        ("captures", "2e9", ("captures 2e+09", "from 0 to 1e+09")),
        ("captures", "30", ("is open loop and has captures",)),
        ("panel_height_px", "-256", ("panel_height_px '-256'", "from 1 to 99999")),
    ],
)
def test_a_wrong_cell_is_refused(handed_in: Path, column: str, value: str, words: tuple[str, ...]) -> None:
    edited(handed_in, column, value, row=0)
    if column == "display":
        edited(handed_in, "condition", value, row=0)
    refused(handed_in, str(handed_in), *words)


def without(*names: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        frame = pd.read_csv(folder / "records.csv", dtype=str, keep_default_na=False)
        frame.drop(columns=list(names)).to_csv(folder / "records.csv", index=False)

    return change


def doubled(folder: Path) -> None:
    text = (folder / "records.csv").read_text()
    (folder / "records.csv").write_text(text + text.splitlines()[1] + "\n")


def more(folder: Path) -> None:
    lines = (folder / "records.csv").read_text().splitlines()
    (folder / "records.csv").write_text("\n".join([f"{lines[0]},beauty", *(f"{line},1" for line in lines[1:])]) + "\n")


def linked(name: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        (folder / name).rename(folder.parent / name)
        (folder / name).symlink_to(folder.parent / name)

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (without("protocol"), ("lacks the columns protocol",)),
        (without("panel_width_px", "measure"), ("lacks the columns measure, panel_width_px",)),
        (more, ("unknown column 'beauty'", "columns.md")),
        (doubled, ("two rows for one cell",)),
        (linked("records.csv"), ("records.csv: a link",)),
        (linked("provenance.json"), ("provenance.json: a link",)),
        (lambda folder: (folder / "provenance.json").unlink(), ("provenance.json: missing",)),
        (lambda folder: (folder / "records.csv").unlink(), ("records.csv: missing",)),
        (lambda folder: (folder / "records.csv").write_bytes(b"\xff\xfe"), ("records.csv: not UTF-8",)),
        (lambda folder: (folder / "records.csv").write_text('a,b\n"1'), ("records.csv: not a table",)),
        (lambda folder: (folder / "records.csv").write_text(""), ("records.csv: not a table",)),
        (lambda folder: (folder / "tests.csv").write_text("a\n1\n"), ("tests.csv: not the table of tests",)),
        (lambda folder: (folder / "provenance.json").write_text("[" * 10**5), ("provenance.json",)),
        (lambda folder: (folder / "provenance.json").write_text("[]"), ("not the provenance of a run",)),
        (lambda folder: told(folder, cpu="\ud800"), ("not Unicode",)),
        (lambda folder: told(folder, profiles=[], files={}), ("lacks profiles",)),
        (lambda folder: told(folder, package=None), ("lacks package", "holoeval run")),
        (lambda folder: told(folder, harness=None), ("lacks harness",)),
        (lambda folder: told(folder, profiles=None), ("lacks profiles",)),
        (lambda folder: told(folder, profiles={"ideal": {"sha256": "12"}}), ("profile 'ideal' has no digest",)),
        (lambda folder: told(folder, by=None), ('lacks "by"', "Our lab")),
        (pretending, ('lacks "by"', "own ones lie below reports, see --own")),
        (lambda folder: told(folder, by=" "), ('"by" is not a name',)),
        (lambda folder: told(folder, by=["a"]), ('"by" is not a name',)),
        (lambda folder: told(folder, by="a\nlab"), ('"by" is not a name',)),
        (lambda folder: told(folder, by=" OWN"), ("which nobody is called here",)),
        (lambda folder: told(folder, profiles={"a\nb": {}}), ("profile 'a\\nb' has no digest",)),
        (lambda folder: told(folder, cpu=float("nan")), ("not finite",)),
        (lambda folder: told(folder, displays={"ideal": "magic"}), ("simulated, real, learned",)),
        (lambda folder: told(folder, displays={"ideal": []}), ("simulated, real, learned",)),
    ],
)
def test_a_wrong_folder_is_refused(handed_in: Path, change: Callable[[Path], object], words: tuple[str, ...]) -> None:
    change(handed_in)
    refused(handed_in, str(handed_in), *words)


def picture(folder: Path) -> Path:
    return sorted((folder / "thumbnails").iterdir())[0]


def truncated(folder: Path) -> None:
    picture(folder).write_bytes(picture(folder).read_bytes()[:60])


def escaping(folder: Path) -> None:
    outside = folder.parent / "outside.png"
    picture(folder).rename(outside)
    (folder / "thumbnails" / outside.name).symlink_to(outside)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda folder: Image.new("RGB", (2000, 20)).save(picture(folder)), ("2000 x 20 pixels", "at most 1024")),
        (lambda folder: Image.new("RGB", (8, 8)).save(picture(folder), "GIF"), ("not a whole PNG",)),
        (lambda folder: picture(folder).write_text("<svg onload=alert(1)>"), ("not a whole PNG",)),
        (truncated, ("not a whole PNG",)),
        (lambda folder: (folder / "thumbnails" / "a.svg").write_text("<svg>"), ("a.svg: not a PNG or JPEG",)),
        (lambda folder: (folder / "thumbnails" / "a").mkdir(), ("a: a link or a folder",)),
        (lambda folder: picture(folder).rename(folder / "thumbnails" / "a.png"), ("a.png: no such cell",)),
        (escaping, ("outside.png: a link",)),
        (linked("thumbnails"), ("thumbnails: not a folder of its own",)),
        (lambda folder: Image.new("I;16", (8, 8)).save(picture(folder)), ("more than 8 bits a channel",)),
        (lambda folder: picture(folder).rename(folder / "thumbnails" / "a\nb.png"), ("'a\\nb.png'", "rename it")),
    ],
)
def test_a_wrong_picture_is_refused(handed_in: Path, change: Callable[[Path], object], words: tuple[str, ...]) -> None:
    change(handed_in)
    refused(handed_in, "thumbnails", *words)


def test_a_picture_of_too_many_bytes_or_pixels_is_refused_before_it_is_decoded(handed_in: Path, monkeypatch) -> None:
    monkeypatch.setattr(Image.Image, "load", lambda self: pytest.fail("decoded"))
    monkeypatch.setattr(pictures, "MOST_PIXELS", 100)
    refused(handed_in, "32 x 24 pixels")
    monkeypatch.setattr(pictures, "MOST_FILE", 10)
    refused(handed_in, "save it smaller")


def test_a_thumbnail_of_others_is_written_anew_pixel_for_pixel(handed_in: Path) -> None:
    path = picture(handed_in)
    before = Image.open(path).convert("RGB").tobytes()
    path.write_bytes(path.read_bytes() + b"<script>alert(1)</script>")
    found = pictures.thumbnails(read(handed_in, OWN), "theirs")
    assert all(b"script" not in each.content for each in found)
    assert found[0].width == 32
    path.write_bytes(found[0].content)
    assert Image.open(path).convert("RGB").tobytes() == before


@pytest.mark.parametrize(("limit", "words"), [("MOST_ROWS", "rows; expected"), ("MOST_LABELS", "labels; expected")])
def test_a_folder_of_too_many_rows_or_labels_is_refused(handed_in: Path, monkeypatch, limit: str, words: str) -> None:
    monkeypatch.setattr(intake, limit, 5)
    refused(handed_in, words, "at most 5")


def test_own_is_what_lies_below_the_folder_of_own_reports_and_names_nobody(tmp_path: Path, study) -> None:
    ours, kept = write_results(tmp_path / "a" / "b", study), write_results(tmp_path / "a" / "c", study, by="Lab")
    assert (read(ours, tmp_path / "a").by, read(kept, tmp_path / "a").by) == ("", "Lab")
    with pytest.raises(UserError, match='lacks "by"'):
        read(ours, tmp_path / "others")


def test_a_folder_without_records_is_named_and_a_bad_one_among_good_ones_stops_the_site(tmp_path, study) -> None:
    own, site = tmp_path / "all", tmp_path / "site"
    write_results(own / "good", study)
    (own / "timings").mkdir()
    assert write_site([own], site, own) == (1, [own / "timings"])
    assert "timings: no records.csv, left out" in (site / "index.html").read_text()
    bad = write_results(own / "bad", study)
    (bad / "records.csv").unlink()
    with pytest.raises(UserError, match=r"bad/records.csv: missing"):
        write_site([own], site, own)


def test_a_linked_report_and_an_output_that_is_no_site_or_overlaps_are_refused(site, tmp_path, passing) -> None:
    (site.own.parent.parent / "all").mkdir()
    (site.own.parent.parent / "all" / "linked").symlink_to(passing)
    with pytest.raises(UserError, match="linked: a link"):
        write_site([site.own.parent.parent / "all"], tmp_path / "site", OWN)
    (tmp_path / "kept.txt").write_text("mine")
    for output, word in ((tmp_path, "no file of"), (site.own / "site", "overlaps"), (site.own.parent, "no file of")):
        with pytest.raises(UserError, match=word):
            write_site([site.own], output, site.own)
    assert [path.name for path in tmp_path.iterdir()] == ["kept.txt"]
