"""Every folder with code is in the list of packages: an editable installation would not miss one that is not."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]


def test_the_list_of_packages_is_complete() -> None:
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    found = set()
    tops = (
        ("holobench_eval", ""),
        ("methods", "holobench_eval."),
        ("datasets", "holobench_eval."),
        ("configs", "holobench_eval."),
    )
    for top, name in tops:
        for file in (ROOT / top).rglob("*.py"):
            found.add(name + ".".join(file.parent.relative_to(ROOT).parts))
    assert sorted(listed) == sorted(found)


def test_a_citation_and_the_changes_name_the_version_and_the_paper() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert (str(cited["version"]), cited["license"]) == (project["version"], project["license"])
    assert cited["authors"] == project["authors"]
    assert f"({project['version']})" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert cited["references"][0]["doi"] in (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", ["README.md", "docs/start/first-run.md"])
def test_a_page_activates_the_environment_before_it_calls_a_command_by_its_name(page: str) -> None:
    lines = [line.strip() for line in (ROOT / page).read_text(encoding="utf-8").splitlines()]
    calls = [line for line in lines if re.match(r"\. \.venv/bin/activate|holoeval |pytest", line)]
    assert calls
    assert calls[0].startswith(". .venv/bin/activate")
