"""The pages: links stay inside, names stay text, equal folders give equal bytes."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest

from holobench_eval.report.site import write_site
from holobench_eval.report.site.html import slug
from tests.report.elements import Elements
from tests.support.results_folder import write_results

from .conftest import HOSTILE, LAB, OTHER, PATH, THEIRS, Site


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


def test_names_open_no_element_and_become_no_path_and_the_policy_lets_nothing_in(
    site: Site, pages: dict[Path, Elements]
) -> None:
    for page in pages.values():
        assert not {"i", "u", "b", "img", "iframe", "script"} & {tag for tag, _ in page.found}
        assert page.opens_nothing()
        assert page.policy.startswith("default-src 'none';")
        assert "unsafe" not in page.policy
        assert "http" not in page.policy
    index = pages[site.output / "index.html"]
    for name in (LAB, THEIRS, PATH):
        assert name in index.text
    assert HOSTILE in pages[site.output / "displays" / "leto-aged.html"].text
    assert all(path.resolve().is_relative_to(site.output) for path in site.output.rglob("*"))


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


def test_a_board_has_methods_in_groups_best_first_with_letters_and_differences(site: Site) -> None:
    page = site.text("displays/leto-aged.html")
    order = ["With photographs of the picture itself", ">HIL<", "No camera", ">Wirtinger<", ">GS, "]
    places = [page.index(text) for text in (*order, "Knows the display", ">Oracle<")]
    assert places == sorted(places)
    assert "GS, 3 of 4 targets" in page
    assert '<path class="mean"' in page
    assert "4 targets." in page
    assert "Study <a" in page


def test_a_method_with_other_settings_is_a_row_of_its_own_and_one_without_any_score_says_so(
    tmp_path: Path, study: list[dict[str, Any]]
) -> None:
    """Rows are told apart by their labels: a budget of 12 captures is not a further run of one of 200."""
    hil = [record for record in study if record["label"] == "HIL"]
    more = [record | {"label": "HIL, 12", "cell": record["cell"] | {"captures": 12}} for record in hil]
    lost = {"state": "failed", "scores": {}, "reason": "no light"}
    records = [record | (lost if record["label"] == "SGD" else {}) for record in (*study, *more)]
    write_site([write_results(tmp_path / "ours", records)], tmp_path / "site", tmp_path)
    page = (tmp_path / "site" / "methods" / "hil.html").read_text()
    assert page.count("A HIL: ") == page.count("A HIL, 12: ") == 2
    page = (tmp_path / "site" / "displays" / "leto-aged.html").read_text()
    assert "SGD, 0 of 4 targets</a></th>\n<td>–</td>" in page


def test_only_studies_that_ask_for_it_enter_the_displays_and_the_question_of_each_is_text(
    tmp_path: Path, study: list[dict[str, Any]]
) -> None:
    folder, site = write_results(tmp_path / "ours", study, known={"board": False}), tmp_path / "site"
    (folder / "board.json").write_text(json.dumps({"question": "Is it <b>better</b>?"}))
    write_site([folder], site, tmp_path)
    assert not (site / "displays").exists()
    assert "No study says" in (site / "index.html").read_text()
    for name in ("index.html", "studies/ours.html"):
        assert "Is it &lt;b&gt;better&lt;/b&gt;?" in (site / name).read_text()
    (folder / "board.json").write_text("[1")
    write_site([folder], site, tmp_path)
    assert "Is it" not in (site / "index.html").read_text()


def test_a_display_of_another_version_has_a_page_of_its_own(tmp_path: Path, study: list[dict[str, Any]]) -> None:
    known = {"profiles": {name: {"version": 1, "sha256": OTHER} for name in ("leto-aged", "ideal")}}
    write_site([write_results(tmp_path / "ours", study, known=known)], tmp_path / "site", tmp_path)
    page = (tmp_path / "site" / "displays" / f"{slug('ideal (22222222)')}.html").read_text()
    assert "Another display, or another version of one" in page
