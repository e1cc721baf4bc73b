"""The site: every link leads to a report, texts stay text, files of somebody stay, and everybody can read it."""

import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest
from PIL import Image

from holobench_eval.core.errors import StorageError, UserError
from holobench_eval.report import site as module
from holobench_eval.report.site import write_site
from tests.report.elements import Elements
from tests.report.page.reading import Reader, reading
from tests.support import synthetic_study as synthetic
from tests.support.axe import serious
from tests.support.reports import files
from tests.support.results_folder import TARGETS, write_results

HOSTILE = '=cmd|"</script><script>alert(1)</script><img src=x onerror=alert(2)></style>'
THEIRS = "<u>theirs: javascript"  # the name of the other folder
OTHER = "2" * 64  # a digest that no profile of the package has


@dataclass(frozen=True)
class Site:
    """The folders of the reports, and where the site is."""

    own: Path
    other: Path
    output: Path

    @property
    def text(self) -> str:
        return (self.output / "index.html").read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def study(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """Records of one made-up study."""
    return synthetic.study(tmp_path_factory.mktemp("study"), size=16, targets=TARGETS)


@pytest.fixture(scope="session")
def passing(tmp_path_factory: pytest.TempPathFactory, study: list[dict[str, Any]]) -> Path:
    return write_results(tmp_path_factory.mktemp("passing") / "theirs", study)


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory, study: list[dict[str, Any]]) -> Site:
    """Over a report, and another whose names try to be markup, formulas and addresses."""
    folder = tmp_path_factory.mktemp("site")
    own = write_results(folder / "reports" / "ours", study)
    (own / "report.md").write_text(
        "## Answer\n\n- Few targets.\n- leto-aged: HIL leads \\*.\n- ideal, both: even.\n\n## More\n\n- No.\n"
    )
    (own / "figures").mkdir()
    Image.new("RGB", (40, 20)).save(own / "figures" / "answer-pictures.jpg")
    hostile = [record | {"label": HOSTILE if record["label"] == "HIL" else record["label"]} for record in study]
    profiles = {name: {"version": 1, "sha256": OTHER} for name in ("leto-aged", "ideal")}
    known = {"profiles": profiles, "board": False, "cpu": HOSTILE}
    other = write_results(folder / "others" / THEIRS, hostile, known=known)
    changed(other, "board.json", lambda text: json.dumps(json.loads(text) | {"title": HOSTILE, "question": HOSTILE}))
    write_site([own.parent, other], folder / "site")
    return Site(own, other, folder / "site")


def changed(folder: Path, name: str, change: Callable[[str], str]) -> None:
    """Write the text of a file anew."""
    (folder / name).write_text(change((folder / name).read_text()))


def test_every_link_leads_to_a_report(site: Site) -> None:
    addresses = [urlsplit(address) for address in Elements(site.text).values("href", "src")]
    links = [unquote(parts.path) for parts in addresses if parts.scheme != "data"]
    assert not any(parts.netloc or parts.scheme not in ("", "data") for parts in addresses)
    assert {(site.output / link).resolve() for link in links} == {each / "report.md" for each in (site.own, site.other)}


def test_texts_open_no_element_and_the_policy_lets_nothing_in(site: Site) -> None:
    page = Elements(site.text)
    assert not {"u", "b", "iframe", "script"} & {tag for tag, _ in page.found}
    assert [given["alt"] for tag, given in page.found if tag == "img"] == ["Pictures of the report"]
    assert page.opens_nothing()
    assert page.policy.startswith("default-src 'none';")
    assert not {"unsafe", "http", "self"} & {word for word in ("unsafe", "http", "self") if word in page.policy}
    assert page.text.count(HOSTILE) > 2


def test_a_card_has_the_answer_of_its_display_and_the_best_row_of_each_group_with_its_difference(site: Site) -> None:
    aged = site.text.partition("<h2>leto-aged</h2>")[2].partition("</section>")[0]
    assert 0 < aged.index("Few targets.") < aged.index("HIL leads *.")  # what is said of all displays is on each card
    assert "even." not in aged
    order = ["With photographs of the picture itself", ">HIL<", "No camera", ">Wirtinger<", "Knows the display"]
    places = [aged.index(text) for text in order]
    assert places == sorted(places)
    assert ">GS" not in aged  # has another letter than the best of its group
    assert "+1.12]°</td>" in aged.partition(">SGD<")[2].partition("</tr>")[0]
    assert aged.count("<article") == aged.count("4 targets.") == aged.count("Seconds on A processor.") == 1
    assert '<td class="difference">+' in aged
    assert "ideal, both: even." in site.text


def test_the_only_row_of_a_group_that_lacks_targets_says_so(tmp_path: Path, study: list[dict[str, Any]]) -> None:
    def lost(record: dict[str, Any]) -> bool:
        return record["label"] == "Oracle" and record["cell"]["target"] != TARGETS[0]

    records = [record | {"state": "failed", "scores": {}} if lost(record) else record for record in study]
    write_site([write_results(tmp_path / "ours", records)], tmp_path / "site")
    text = (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
    assert text.count("1 of 4 targets") == 2  # on each display
    assert "4 of 4 targets" not in text


def test_a_display_of_another_version_is_a_display_of_its_own(site: Site) -> None:
    page = Elements(site.text)
    assert f"<h2>leto-aged ({OTHER[:8]})</h2>\n<p>Another display, or another version" in site.text
    assert len([tag for tag, _ in page.found if tag == "option"]) == 5  # two displays of two versions, and all


def test_equal_folders_give_equal_bytes_and_an_earlier_page_is_replaced(site: Site, tmp_path: Path) -> None:
    moved = Path(shutil.copytree(site.own.parents[1], tmp_path / "elsewhere", ignore=shutil.ignore_patterns("site")))
    write_site([moved / "reports"], moved / "site")
    (moved / "site" / f"{module.TEMPORARY}x").write_text("half")  # of a site that was interrupted
    write_site([moved / "reports", moved / "others"], moved / "site")
    assert (moved / "site" / "index.html").read_bytes() == (site.output / "index.html").read_bytes()


@pytest.mark.parametrize("name", ["CNAME", "index.html", "methods/mine.html", ".git/HEAD"])
def test_files_of_somebody_in_the_output_are_refused_and_kept(tmp_path: Path, passing: Path, name: str) -> None:
    write_site([passing], tmp_path)
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text("mine")
    before = files(tmp_path)
    with pytest.raises(UserError, match="which is no file of a site"):
        write_site([passing], tmp_path)
    assert files(tmp_path) == before


def test_nothing_is_written_through_a_link_or_into_a_report(tmp_path: Path, passing: Path) -> None:
    site, outside = tmp_path / "site", tmp_path / "outside"
    write_site([passing], site)
    (site / "index.html").rename(outside)
    (site / "index.html").symlink_to(outside)
    before = outside.read_bytes()
    with pytest.raises(UserError, match="which is no file of a site"):
        write_site([passing], site)
    assert outside.read_bytes() == before
    with pytest.raises(UserError, match="overlaps"):
        write_site([passing], passing / "site")


def with_half_a_picture(folder: Path) -> None:
    (folder / "figures").mkdir()
    (folder / "figures" / "answer-pictures.jpg").write_bytes(b"\xff\xd8\xff")


@pytest.mark.parametrize(
    "damage",
    [
        *(lambda folder, name=name: (folder / name).unlink() for name in ("board.json", "report.md")),
        *(
            lambda folder, text=text: (folder / "board.json").write_text(text)
            for text in ("{", "[" * 10**5, "[]", '{"headline": {"key": 3}}')
        ),
        lambda folder: changed(folder, "board.json", lambda text: text.replace('"mean": ', '"mean": "x", "m": ')),
        lambda folder: (folder / "provenance.json").write_text("[]"),
        lambda folder: (folder / "provenance.json").write_text('{"profiles": {"ideal": {"sha256": 1}}}'),
        lambda folder: (folder / "report.md").write_bytes(b"\xff"),
        with_half_a_picture,
    ],
)
def test_a_damaged_or_missing_file_is_one_line_that_names_the_folder(tmp_path: Path, passing: Path, damage) -> None:
    folder = Path(shutil.copytree(passing, tmp_path / "ours"))
    damage(folder)
    with pytest.raises(UserError, match=rf"^{folder}[^\n]*; mend its files, or write the report again$"):
        write_site([folder], tmp_path / "site")
    assert not (tmp_path / "site").exists()


def test_a_full_disk_leaves_the_earlier_page(tmp_path: Path, passing: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_site([passing], tmp_path)
    before = files(tmp_path)

    def full(path: Path, content: bytes) -> None:
        raise StorageError("No space left")

    monkeypatch.setattr(module, "write_atomically", full)
    with pytest.raises(StorageError):
        write_site([passing], tmp_path)
    assert files(tmp_path) == before


@pytest.fixture
def reader(browser: Any, site: Site) -> Iterator[Reader]:
    opened = Reader(browser.new_page(viewport={"width": 1000, "height": 800}), f"{site.output.as_uri()}/")
    with reading(opened, "index.html"):
        yield opened


def test_a_choice_of_the_list_shows_a_display_and_the_last_one_all(reader: Reader) -> None:
    headings = reader.page.locator("h2:visible")
    assert headings.count() == 1
    reader.page.select_option("#display", label="ideal")
    assert headings.all_inner_texts() == ["ideal"]
    reader.page.select_option("#display", label="all displays")
    assert headings.count() == 4


def test_the_page_asks_for_nothing_and_the_policy_stops_what_would_leave_it(reader: Reader) -> None:
    assert [address for address in reader.asked if not address.startswith("data:")] == [f"{reader.address}index.html"]
    asked = reader.page.evaluate("() => fetch('https://example.org/').then(() => 'sent', () => 'refused')")
    assert asked == "refused"
    assert all("example.org" in message for message in reader.wrong)  # the browser says that it was refused
    reader.wrong.clear()


@pytest.mark.parametrize(("scheme", "width"), [("light", 400), ("dark", 1400)])
def test_axe_finds_nothing_serious_and_nothing_is_wider_than_the_window(browser, site, scheme, width) -> None:
    page = browser.new_page(viewport={"width": width, "height": 800}, color_scheme=scheme)
    with reading(Reader(page, f"{site.output.as_uri()}/"), "index.html"):
        page.select_option("#display", label="all displays")
        assert serious(page) == []
        assert page.evaluate("() => document.documentElement.scrollWidth") <= width
