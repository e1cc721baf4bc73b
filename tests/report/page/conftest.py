"""A page of made-up captures, whose names try to be markup, formulas and separators."""

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.report import Facts, write_report
from holobench_eval.report.description import Description, Display
from tests.support import synthetic_study as synthetic

HOSTILE = '=cmd|"</script><script>alert(1)</script><img src=x onerror=alert(2)> & `_*'
TITLE = "Made-up </title><script>alert(3)</script> captures"
CONFIG = "title: x # </pre><script>alert(4)</script>\n"
TARGETS = synthetic.TARGETS[:4]


@dataclass(frozen=True)
class Written:
    """A report's folder, its facts, and the text of its page."""

    folder: Path
    facts: Facts
    text: str

    @property
    def data(self) -> Any:
        found = re.search(r'<script type="application/json" id="data">(.*?)</script>', self.text, re.DOTALL)
        assert found
        return json.loads(found[1])


def renamed(name: str) -> str:
    return HOSTILE if name == "GS" else name


@pytest.fixture(scope="session")
def written(tmp_path_factory: pytest.TempPathFactory) -> Written:
    folder = tmp_path_factory.mktemp("page")
    records = [
        record | {"label": renamed(record["label"]), "cpu_s": record["seconds"]}
        for record in synthetic.study(folder, size=48, targets=TARGETS)
    ]
    pairs = tuple((renamed(label), condition) for label, condition in synthetic.facts().pairs)
    facts = synthetic.facts(title=TITLE, targets=TARGETS, pairs=pairs)
    description = Description((Display("leto-aged", f"Version {HOSTILE}", (HOSTILE,)),), "x.yaml", CONFIG)
    write_report(facts, records, folder, {"cpu": HOSTILE}, description)
    return Written(folder, facts, (folder / "report.html").read_text())
