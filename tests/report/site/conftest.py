"""A site over a report and another, whose names try to be markup, formulas and paths."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.report.site import write_site
from tests.support import synthetic_study as synthetic
from tests.support.results_folder import TARGETS, write_results

HOSTILE = '=cmd|"</script><script>alert(1)</script><img src=x onerror=alert(2)>'
PATH = "../../<b>evil</b>.py:Method"
THEIRS = "<u>theirs"  # the name of the other folder
OTHER = "2" * 64  # a digest that no profile of the package has


@dataclass(frozen=True)
class Site:
    """The folders of the reports, and where the site is."""

    own: Path
    other: Path
    output: Path

    def text(self, name: str) -> str:
        return (self.output / name).read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def study(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """Records of one made-up study."""
    return synthetic.study(tmp_path_factory.mktemp("study"), size=16, targets=TARGETS)


def renamed(study: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The same study with another method in the place of HIL, a dB better, solved again."""
    changed = []
    for record in study:
        cell, scores, label = dict(record["cell"]), dict(record["scores"]), record["label"]
        if label == "HIL":
            label, cell["method"] = HOSTILE, PATH
            scores["psnr_linear"] += 1.0
        cell["seed"] = 7
        changed.append(record | {"label": label, "cell": cell, "scores": scores})
    return changed


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory, study: list[dict[str, Any]]) -> Site:
    folder = tmp_path_factory.mktemp("site")
    own = write_results(folder / "reports" / "ours", study)
    other = write_results(folder / "others" / THEIRS, renamed(study))
    write_site([own.parent, other], folder / "site")
    return Site(own, other, folder / "site")


@pytest.fixture(scope="session")
def passing(tmp_path_factory: pytest.TempPathFactory, study: list[dict[str, Any]]) -> Path:
    return write_results(tmp_path_factory.mktemp("passing") / "theirs", study)
