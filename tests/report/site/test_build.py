"""What the output folder loses: files that an earlier site wrote, and nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from holobench_eval.core.errors import StorageError, UserError
from holobench_eval.report.site import build, write_site
from tests.support.reports import files
from tests.support.results_folder import write_results

OWN = Path("reports")


@pytest.mark.parametrize(
    ("is_site", "names"),
    [
        (False, ("assets/site.css", "assets/logo.svg", "pictures/holiday.jpg", "index.html")),
        (True, ("CNAME",)),
        (True, ("methods/mine.html",)),
        (True, (".git/HEAD",)),
    ],
)
def test_files_of_somebody_in_the_output_are_refused_and_kept(
    tmp_path: Path, passing: Path, is_site: bool, names: tuple[str, ...]
) -> None:
    if is_site:
        write_site([passing], tmp_path, OWN)
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("mine")
    before = files(tmp_path)
    with pytest.raises(UserError, match="which is no file of a site"):
        write_site([passing], tmp_path, OWN)
    assert files(tmp_path) == before


@pytest.mark.parametrize("name", ["methods", "index.html", "files-of-the-site.txt"])
def test_nothing_is_written_through_a_link(tmp_path: Path, passing: Path, name: str) -> None:
    site, outside = tmp_path / "site", tmp_path / "outside"
    write_site([passing], site, OWN)
    (site / name).rename(outside)
    (site / name).symlink_to(outside)
    before = files(outside) if outside.is_dir() else outside.read_bytes()
    with pytest.raises(UserError, match="which is no file of a site"):
        write_site([passing], site, OWN)
    assert (files(outside) if outside.is_dir() else outside.read_bytes()) == before


@pytest.mark.parametrize(("left", "earlier"), [(0, True), (1, False), (5, True), (5, False)])
def test_a_site_that_was_interrupted_is_written_by_the_same_command(
    tmp_path: Path, passing: Path, study: list[dict[str, Any]], left: int, earlier: bool
) -> None:
    expected, site = tmp_path / "expected", tmp_path / "site"
    write_site([passing], expected, OWN)
    if earlier:
        write_site([write_results(tmp_path / "stale", study, by="Another lab")], site, OWN)

    def full(path: Path, content: bytes) -> None:
        nonlocal left
        if not left:
            (path.parent / ".writing-abc").write_bytes(b"half") if path.parent.is_dir() else None
            raise StorageError("No space left")
        left -= 1
        write(path, content)

    with pytest.MonkeyPatch.context() as patch:
        write = build.write_atomically
        patch.setattr(build, "write_atomically", full)
        with pytest.raises(StorageError):
            write_site([passing], site, OWN)
    write_site([passing], site, OWN)
    assert files(site) == files(expected)


def test_two_files_of_one_name_are_refused_and_a_figure_and_a_thumbnail_of_one_are_two_files(
    tmp_path: Path, handed_in: Path
) -> None:
    path = sorted((handed_in / "thumbnails").iterdir())[0]
    (handed_in / "figures").mkdir()
    for name in (path.name, "Quality-a.png", "quality-A.png"):
        (handed_in / "figures" / name).write_bytes(path.read_bytes())
    write_site([handed_in], tmp_path / "site", OWN)
    pictures = tmp_path / "site" / "pictures" / "theirs"
    assert len([each for each in pictures.iterdir() if each.is_file()]) == 3
    assert len(list((pictures / "captures").iterdir())) == 2
    path.with_suffix(".PNG").write_bytes(path.read_bytes())
    with pytest.raises(UserError, match="two files of the site would have this name"):
        write_site([handed_in], tmp_path / "another", OWN)


def test_labs_whose_names_differ_by_case_or_space_alone_are_refused(
    tmp_path: Path, study: list[dict[str, Any]]
) -> None:
    folders = [write_results(tmp_path / name, study, by=name) for name in ("Our Lab", "our  lab")]
    with pytest.raises(UserError, match="expected one name"):
        write_site(folders, tmp_path / "site", OWN)
