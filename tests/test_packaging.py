"""Every folder with code is in the list of packages: an editable installation would not miss one that is not."""

import tomllib
from pathlib import Path

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
