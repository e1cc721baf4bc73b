"""The site: links stay inside, names stay text, files of somebody stay, and everybody can read it."""

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest

from holobench_eval.core.errors import StorageError, UserError
from holobench_eval.report.site import build, write_site
from holobench_eval.report.site.html import slug
from tests.report.elements import Elements
from tests.report.page.reading import Reader, reading
from tests.support.axe import serious
from tests.support.reports import files
from tests.support.results_folder import write_results

from .conftest import HOSTILE, OTHER, PATH, THEIRS, Site


@pytest.fixture(scope="module")
def pages(site: Site) -> dict[Path, Elements]:
    return {path: Elements(path.read_text(encoding="utf-8")) for path in sorted(site.output.rglob("*.html"))}


def test_every_link_leads_to_a_file_of_the_site(site: Site, pages: dict[Path, Elements]) -> None:
    followed = 0
    for path, page in pages.items():
        for address in page.values("href", "src"):
            parts = urlsplit(address)
            if address == "data:,":
                continue
            assert not parts.scheme
            assert not parts.netloc
            there = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert there.is_file(), address
            assert there.is_relative_to(site.output)
            if parts.fragment:
                assert parts.fragment in pages[there].values("id")
            followed += 1
    assert followed > 100


def test_there_is_a_page_for_every_method_display_and_study(site: Site) -> None:
    found = {path.relative_to(site.output).as_posix() for path in site.output.rglob("*.html")}
    methods = ("double_phase", "gerchberg_saxton", "wirtinger", "sgd", "hil", "oracle", PATH)
    wanted = {f"methods/{slug(name)}.html" for name in methods}
    wanted |= {f"displays/{name}.html" for name in ("leto-aged", "ideal")}
    wanted |= {f"studies/{slug(name)}.html" for name in ("ours", THEIRS)}
    assert found == wanted | {"index.html"}


def test_names_open_no_element_and_become_no_path_and_the_policy_lets_nothing_in(site: Site, pages) -> None:
    for page in pages.values():
        assert not {"i", "u", "b", "img", "iframe", "script"} & {tag for tag, _ in page.found}
        assert page.opens_nothing()
        assert page.policy.startswith("default-src 'none';")
        assert "unsafe" not in page.policy
        assert "http" not in page.policy
    index = pages[site.output / "index.html"]
    for name in (THEIRS, PATH):
        assert name in index.text
    assert HOSTILE in pages[site.output / "displays" / "leto-aged.html"].text
    assert all(path.resolve().is_relative_to(site.output) for path in site.output.rglob("*"))


def test_equal_folders_give_equal_bytes_and_nothing_of_an_earlier_site_is_left(site, tmp_path, study) -> None:
    moved = tmp_path / "elsewhere"
    shutil.copytree(site.own, moved / "reports" / "ours")
    shutil.copytree(site.other, moved / "others" / site.other.name)
    stale = write_results(moved / "stale", study, known={"harness": "3"})
    write_site([stale], moved / "site")
    write_site([moved / "reports", moved / "others"], moved / "site")
    first, second = (
        {path.relative_to(root): path.read_bytes() for path in sorted(root.rglob("*")) if path.is_file()}
        for root in (site.output, moved / "site")
    )
    assert first.keys() == second.keys()
    assert first == second


def test_a_board_has_methods_in_groups_best_first_with_letters_and_differences(site: Site) -> None:
    page = site.text("displays/leto-aged.html")
    order = ["With photographs of the picture itself", ">HIL<", "No camera", ">Wirtinger<", ">GS, "]
    places = [page.index(text) for text in (*order, "Knows the display", ">Oracle<")]
    assert places == sorted(places)
    assert "GS, 3 of 4 targets" in page
    assert '<path class="mean"' in page
    assert "4 targets." in page
    assert "Study <a" in page


def test_a_method_with_other_settings_or_without_any_score_is_a_row_of_its_own(tmp_path, study) -> None:
    """Rows are told apart by their labels: a budget of 12 captures is not a further run of one of 200."""
    hil = [record for record in study if record["label"] == "HIL"]
    more = [record | {"label": "HIL, 12", "cell": record["cell"] | {"captures": 12}} for record in hil]
    lost = {"state": "failed", "scores": {}, "reason": "no light"}
    records = [record | (lost if record["label"] == "SGD" else {}) for record in (*study, *more)]
    write_site([write_results(tmp_path / "ours", records)], tmp_path / "site")
    page = (tmp_path / "site" / "methods" / "hil.html").read_text()
    assert page.count("A HIL: ") == page.count("A HIL, 12: ") == 2
    page = (tmp_path / "site" / "displays" / "leto-aged.html").read_text()
    assert "SGD, 0 of 4 targets</a></th>\n<td>–</td>" in page


def test_only_studies_that_ask_for_it_enter_the_displays_with_their_question_as_text(tmp_path, study) -> None:
    folder, site = write_results(tmp_path / "ours", study, known={"board": False}), tmp_path / "site"
    board = json.loads((folder / "board.json").read_text())
    (folder / "board.json").write_text(json.dumps(board | {"question": "Is it <b>better</b>?"}))
    write_site([folder], site)
    assert not (site / "displays").exists()
    assert "No study says" in (site / "index.html").read_text()
    for name in ("index.html", "studies/ours.html"):
        assert "Is it &lt;b&gt;better&lt;/b&gt;?" in (site / name).read_text()


def test_a_display_of_another_version_has_a_page_of_its_own(tmp_path: Path, study: list[dict[str, Any]]) -> None:
    known = {"profiles": {name: {"version": 1, "sha256": OTHER} for name in ("leto-aged", "ideal")}}
    write_site([write_results(tmp_path / "ours", study, known=known)], tmp_path / "site")
    page = (tmp_path / "site" / "displays" / f"{slug('ideal (22222222)')}.html").read_text()
    assert "Another display, or another version of one" in page


@pytest.mark.parametrize(
    ("is_site", "names"),
    [
        (False, ("assets/site.css", "assets/logo.svg", "pictures/holiday.jpg", "index.html")),
        (True, ("CNAME",)),
        (True, ("methods/mine.html",)),
        (True, (".git/HEAD",)),
    ],
)
def test_files_of_somebody_in_the_output_are_refused_and_kept(tmp_path, passing, is_site, names) -> None:
    if is_site:
        write_site([passing], tmp_path)
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("mine")
    before = files(tmp_path)
    with pytest.raises(UserError, match="which is no file of a site"):
        write_site([passing], tmp_path)
    assert files(tmp_path) == before


@pytest.mark.parametrize("name", ["methods", "index.html", "files-of-the-site.txt"])
def test_nothing_is_written_through_a_link(tmp_path: Path, passing: Path, name: str) -> None:
    site, outside = tmp_path / "site", tmp_path / "outside"
    write_site([passing], site)
    (site / name).rename(outside)
    (site / name).symlink_to(outside)
    before = files(outside) if outside.is_dir() else outside.read_bytes()
    with pytest.raises(UserError, match="which is no file of a site"):
        write_site([passing], site)
    assert (files(outside) if outside.is_dir() else outside.read_bytes()) == before


@pytest.mark.parametrize(("left", "earlier"), [(0, True), (1, False), (5, True)])
def test_a_site_that_was_interrupted_is_written_by_the_same_command(tmp_path, passing, study, left, earlier) -> None:
    expected, site = tmp_path / "expected", tmp_path / "site"
    write_site([passing], expected)
    if earlier:
        write_site([write_results(tmp_path / "stale", study)], site)

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
            write_site([passing], site)
    write_site([passing], site)
    assert files(site) == files(expected)


def changed(name: str, change: Callable[[str], str]) -> Callable[[Path], object]:
    """Write the text of a file anew."""
    return lambda folder: (folder / name).write_text(change((folder / name).read_text()))


def without(name: str) -> Callable[[Path], object]:
    return lambda folder: (folder / name).unlink()


def told(**values: Any) -> Callable[[Path], object]:
    """Change the provenance."""
    return changed("provenance.json", lambda text: json.dumps(json.loads(text) | values))


def with_half_a_figure(folder: Path) -> None:
    (folder / "figures").mkdir()
    (folder / "figures" / "quality-a.png").write_bytes(b"\x89PNG\r\n\x1a\n")


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        *((without(name), name) for name in ("records.csv", "provenance.json", "board.json", "table.csv")),
        (changed("records.csv", lambda text: text.partition("\n")[0]), "mend its files"),
        (changed("records.csv", lambda text: text.replace("psnr_linear_db", "psnr_linear_x")), "psnr_linear"),
        (changed("records.csv", lambda text: 'a,b\n"1'), "tokenizing data"),
        (changed("board.json", lambda text: text[:9]), "JSONDecodeError"),
        (changed("board.json", lambda text: "[" * 10**5), "RecursionError"),
        (changed("board.json", lambda text: "[]"), "mend its files"),
        (changed("table.csv", lambda text: "a\n1\n"), "parameters"),
        (changed("provenance.json", lambda text: "[]"), "not the provenance of a run"),
        (told(profiles=[]), "mend its files"),
        (told(profiles={"ideal": {"sha256": 1}}), "mend its files"),
        (lambda folder: (folder / "report.md").write_bytes(b"\xff"), "UnicodeDecodeError"),
        (with_half_a_figure, "figures/quality-a.png is not a whole picture"),
    ],
)
def test_a_damaged_or_missing_file_is_one_line_that_names_the_folder(tmp_path, passing, damage, words) -> None:
    folder = Path(shutil.copytree(passing, tmp_path / "ours"))
    damage(folder)
    with pytest.raises(UserError) as error:
        write_site([folder], tmp_path / "site")
    assert "\n" not in str(error.value)
    assert str(folder) in str(error.value)
    assert words in str(error.value)
    assert not (tmp_path / "site").exists()


def test_a_folder_without_records_is_named_and_an_output_that_overlaps_is_refused(tmp_path, passing) -> None:
    shutil.copytree(passing, tmp_path / "all" / "good")
    (tmp_path / "all" / "timings").mkdir()
    with pytest.raises(UserError, match="overlaps"):
        write_site([tmp_path / "all"], tmp_path / "all" / "good" / "site")
    assert write_site([tmp_path / "all"], tmp_path / "site") == (1, [tmp_path / "all" / "timings"])
    assert "timings: no records.csv, left out" in (tmp_path / "site" / "index.html").read_text()


@pytest.fixture
def reader(browser: Any, site: Site) -> Iterator[Reader]:
    found = Reader(browser.new_page(viewport={"width": 1000, "height": 800}), f"{site.output.as_uri()}/")
    with reading(found, "index.html"):
        yield found


def test_opening_asks_for_the_files_of_the_site_alone(reader: Reader) -> None:
    for name in ("index.html", "methods/hil.html", "displays/ideal.html", "studies/ours.html"):
        reader.open(name)
        assert len(reader.asked) >= 3
        assert all(address.startswith(reader.address) for address in reader.asked)


def test_the_policy_stops_what_would_leave_the_site(reader: Reader) -> None:
    asked = reader.page.evaluate("() => fetch('https://example.org/').then(() => 'sent', () => 'refused')")
    assert asked == "refused"
    assert not [address for address in reader.asked if "example.org" in address]
    assert all("example.org" in message for message in reader.wrong)  # the browser says that it was refused
    reader.wrong.clear()


@pytest.mark.parametrize(
    ("scheme", "width", "names"),
    [("light", 400, ("methods/gerchberg_saxton", "displays/leto-aged")), ("dark", 1400, ("studies/ours",))],
)
def test_axe_finds_nothing_serious_and_nothing_is_wider_than_the_window(browser, site, scheme, width, names) -> None:
    page = browser.new_page(viewport={"width": width, "height": 800}, color_scheme=scheme)
    reader = Reader(page, f"{site.output.as_uri()}/")
    for name in ("index", *names):
        reader.open(f"{name}.html")
        assert serious(page) == []
        assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert not reader.wrong
    page.close()
