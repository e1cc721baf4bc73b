"""The pages: links stay inside, names stay text, equal folders give equal bytes."""

from __future__ import annotations

import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest

from holobench_eval.display.simulated.profile import load_profile, names
from holobench_eval.report.site import write_site
from holobench_eval.report.site.displays import ASSUMED, DRAWN, FITTED, STATED, parameters
from holobench_eval.report.site.html import slug
from holobench_eval.report.site.intake import read
from holobench_eval.report.site.standing import groups
from tests.support.results_folder import write_results

from .conftest import HOSTILE, LAB, PATH, THEIRS, Site


class Elements(HTMLParser):
    """The elements of a page, its text, and its links."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.text += data

    @property
    def addresses(self) -> list[str]:
        return [str(given[name]) for _, given in self.found for name in ("href", "src") if given.get(name)]

    @property
    def ids(self) -> set[str]:
        return {str(given["id"]) for _, given in self.found if "id" in given}


@pytest.fixture(scope="module")
def pages(site: Site) -> dict[Path, Elements]:
    return {path: Elements(path) for path in sorted(site.output.rglob("*.html"))}


def test_every_link_leads_to_a_file_of_the_site(site: Site, pages: dict[Path, Elements]) -> None:
    followed = 0
    for path, page in pages.items():
        for address in page.addresses:
            parts = urlsplit(address)
            if address == "data:,":
                continue
            assert not parts.scheme
            assert not parts.netloc
            there = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert there.is_file(), address
            assert there.is_relative_to(site.output)
            if parts.fragment:
                assert parts.fragment in pages[there].ids
            followed += 1
    assert followed > 200


def test_there_is_a_page_for_every_method_display_and_study(site: Site) -> None:
    found = {path.relative_to(site.output).as_posix() for path in site.output.rglob("*.html")}
    methods = ("double_phase", "gerchberg_saxton", "wirtinger", "sgd", "hil", "oracle", PATH)
    wanted = {f"methods/{slug(name)}.html" for name in methods}
    wanted |= {f"displays/{name}.html" for name in ("leto-aged", "ideal")}
    wanted |= {f"studies/{slug(name)}.html" for name in ("ours", THEIRS)}
    assert found == wanted | {"index.html"}


def test_names_open_no_element_and_become_no_path(site: Site, pages: dict[Path, Elements]) -> None:
    for path, page in pages.items():
        assert not {"i", "u", "b", "img", "iframe"} & {tag for tag, _ in page.found}
        assert not [given for _, given in page.found if any(name.startswith("on") or name == "style" for name in given)]
        scripts = [given.get("src") for tag, given in page.found if tag == "script"]
        assert scripts == (["assets/leaderboard.js"] if path.name == "index.html" else [])
    index = pages[site.output / "index.html"]
    for name in (HOSTILE, LAB, THEIRS, PATH):
        assert name in index.text
    assert all(path.resolve().is_relative_to(site.output) for path in site.output.rglob("*"))


def test_the_policy_lets_nothing_but_the_files_of_the_site_in(pages: dict[Path, Elements]) -> None:
    for page in pages.values():
        policy = next(str(given["content"]) for _, given in page.found if "http-equiv" in given)
        assert policy.startswith("default-src 'none';")
        assert "unsafe" not in policy
        assert "http" not in policy


def test_equal_folders_give_equal_bytes_and_nothing_of_an_earlier_site_is_left(
    site: Site, tmp_path: Path, study: list[dict[str, Any]]
) -> None:
    moved = tmp_path / "elsewhere"
    shutil.copytree(site.own, moved / "reports" / "ours")
    shutil.copytree(site.other, moved / "others" / site.other.name)
    stale = write_results(moved / "stale", study, known={"harness": "3"})
    write_site([stale], moved / "site", moved)
    write_site([moved / "reports", moved / "others"], moved / "site", moved / "reports")
    first, second = (
        {path.relative_to(root): path.read_bytes() for path in sorted(root.rglob("*")) if path.is_file()}
        for root in (site.output, moved / "site")
    )
    assert first.keys() == second.keys()
    assert first == second


def test_holes_are_said_and_never_zero(site: Site) -> None:
    page = site.text("methods/gerchberg_saxton.html")
    assert '<span class="hole">3 of 4, 1 failed</span>' in page
    assert "not ranked" in page
    assert 'data-gain=""' in page


def test_a_row_without_any_score_says_so(tmp_path: Path, study: list[dict[str, Any]]) -> None:
    records = [
        record | ({"state": "failed", "scores": {}, "reason": "no light"} if record["label"] == "SGD" else {})
        for record in study
    ]
    write_site([write_results(tmp_path / "ours", records)], tmp_path / "site", tmp_path)
    page = (tmp_path / "site" / "methods" / "sgd.html").read_text()
    assert '<span class="hole">no score</span>' in page
    assert "0 of 4, 4 failed" in page
    assert 'data-score=""' in page


def test_question_and_answer_of_a_report_are_shown_without_links(site: Site) -> None:
    page = site.text("studies/ours.html")
    assert "Is it &lt;b&gt;better&lt;/b&gt;?" in page
    assert "[Yes](https://example.org)" in page
    assert "<h2>More</h2>" not in page
    assert "reports/ours/report.md" in page
    assert 'href="../../' not in page
    assert "report.md" not in site.text(f"studies/{slug(THEIRS)}.html").replace("has no report.md", "")


@pytest.mark.parametrize("name", ["our-bench", "../=cmd|<b>bench</b>"])
def test_a_real_display_is_marked_whatever_its_name(tmp_path: Path, study: list[dict[str, Any]], name: str) -> None:
    def renamed(record: dict[str, Any]) -> dict[str, Any]:
        cell = record["cell"]
        condition = name if cell["condition"] == "leto-aged" else cell["condition"]
        return record | {"cell": cell | {"profile": name, "condition": condition}}

    records = [renamed(record) for record in study if record["cell"]["condition"] != "ideal"]
    known = {"profiles": {name: {"version": 1, "sha256": "3" * 64}}, "displays": {name: "real"}}
    write_site([write_results(tmp_path / "ours", records, known=known)], tmp_path / "site", tmp_path)
    index = Elements(tmp_path / "site" / "index.html")
    assert ("option", {"value": f"{name}, real"}) in index.found
    pages = list((tmp_path / "site" / "displays").iterdir())
    assert [page.name for page in pages] == [f"{slug(name)}.html"]
    assert "A real bench" in pages[0].read_text()
    assert "b" not in {tag for tag, _ in Elements(pages[0]).found}


def test_the_page_of_a_display_has_its_parameters_with_their_sources(site: Site) -> None:
    page = site.text("displays/leto-aged.html")
    for text in (
        "LETO-I; paper 5.1",
        "of the power; up to 0.2 is usual, 0.35 reported; CALIBRATED",
        "sub-samples a pixel",
    ):
        assert text in page
    assert "none was measured on a real panel" in page


def test_what_a_profile_assumes_is_read_from_its_comments() -> None:
    basis = {
        ("leto-aged", "panel", "pitch"): STATED,
        ("leto-aged", "panel", "distance"): ASSUMED,
        ("leto-aged", "zero_order", "fraction"): FITTED,
        ("leto-2020", "crosstalk", "crosstalk"): DRAWN,
        ("leto-2020", "coherent_noise", "specks"): DRAWN,
        ("leto-aged", "coherent_noise", "specks"): ASSUMED,  # "assumed, as the next six"
        ("leto-aged", "coherent_noise", "plane_distance"): ASSUMED,
        ("leto-2020", "propagation", "distance_error"): DRAWN,
        ("leto-2020", "drift", "pose"): ASSUMED,  # said of the entire stage
    }
    found = {(name, each.stage, each.key): each for name in ("leto-2020", "leto-aged") for each in parameters(name)}
    assert {key: found[key].basis for key in basis} == basis
    assert found["leto-2020", "propagation", "aberration"].source.startswith("rms waves at 517 nm")


@pytest.mark.parametrize("name", names())
def test_no_parameter_of_a_profile_is_lost(name: str) -> None:
    profile = load_profile(name)
    keys = {(each.stage, each.key) for each in parameters(name)}
    assert keys
    if profile.like is None:
        assert {("panel", "pitch"), ("panel", "wavelengths"), ("panel", "distance")} <= keys


@pytest.mark.parametrize(
    "pair", [("HIL", "hil"), ("a/b", "a_b"), ("..", "."), ("é", "e"), ("x" * 200, "x" * 201), ("a b", slug("a b"))]
)
def test_no_two_names_share_a_file_on_any_file_system(pair: tuple[str, str]) -> None:
    first, second = map(slug, pair)
    assert first.lower() != second.lower()
    assert all("/" not in name and name.strip(".") for name in (first, second))


@pytest.mark.parametrize("name", ["con", "nul", "COM1", "com1.x", "lpt9", "a.", ""])
def test_no_name_is_that_of_a_device_or_ends_in_a_dot(name: str) -> None:
    assert re.fullmatch(r"[a-z0-9_.]*-[0-9a-f]{8}", slug(name))
    assert "." not in slug(name)


def test_no_report_of_others_and_no_linked_report_is_named(tmp_path: Path, study: list[dict[str, Any]]) -> None:
    other = write_results(tmp_path / "theirs", study, by="Lab")
    (other / "report.html").write_text("<script>alert(1)</script>")
    own = write_results(tmp_path / "ours", study)
    (own / "report.html").symlink_to("/etc/hostname")
    write_site([other, own], tmp_path / "site", tmp_path)
    theirs, ours = (Elements(tmp_path / "site" / "studies" / f"{name}.html") for name in ("theirs", "ours"))
    assert "report.html" not in theirs.text + ours.text
    assert "ours/report.md" in ours.text


def test_a_kind_that_is_told_is_taken_and_a_network_is_recognised_without(
    tmp_path: Path, study: list[dict[str, Any]]
) -> None:
    folder = write_results(tmp_path / "ours", study)
    known = json.loads((folder / "provenance.json").read_text())
    known["displays"] = {"ideal": "real", "leto-aged": "simulated"}
    (folder / "provenance.json").write_text(json.dumps(known))
    assert {group.display.marked for group in groups([read(folder, folder)])} == {
        f"ideal photographed ({load_profile('ideal').digest[:8]}), real",
        "leto-aged",
    }
