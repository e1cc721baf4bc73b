"""``docs/handles.md`` from docstrings: ``python -m tests.docs.handles_page`` writes it."""

import inspect
import re
from collections.abc import Iterator
from pathlib import Path

from holobench_eval.core.parameters import meanings
from holobench_eval.display.api import DisplaySpec
from holobench_eval.display.metered import MeteredDisplay
from holobench_eval.display.training import TrainingBench
from tests.docs.sections import introduction

PAGE = Path(__file__).parents[2] / "docs" / "handles.md"

HANDLES = (
    ("In `solve`: a `MeteredDisplay`", "bench", MeteredDisplay),
    ("In `prepare`: a `TrainingBench`", "bench", TrainingBench),
    ("Its optics: a `DisplaySpec`", "bench.spec", DisplaySpec),
)
OWN = {"simulation", "seed", "known", "journal"}  # what the harness and the oracle use


def page() -> str:
    """The text of the page: what stands above the mark, and a table a handle and one of the optics."""
    parts = [introduction(PAGE, "handles_page")]
    for title, name, cls in HANDLES:
        fields = [f"| `{name}.{field}` | {_text(text)} |" for field, text in meanings(cls).items() if field not in OWN]
        parts.append("\n".join([f"## {title}\n", "| | |", "|---|---|", *fields, *_members(name, cls), ""]))
    return "\n".join(parts)


def _members(owner: str, cls: type) -> Iterator[str]:
    for name, member in inspect.getmembers(cls, lambda member: callable(member) or isinstance(member, property)):
        if name[0] != "_" and name not in OWN:
            given = inspect.signature(member).parameters.values() if callable(member) else ()
            call = ", ".join(str(each.replace(annotation=each.empty)) for each in given if each.name != "self")
            shown = f"{owner}.{name}({call})" if callable(member) else f"{owner}.{name}"
            yield f"| `{shown}` | {_text((inspect.getdoc(member) or '').partition(chr(10) * 2)[0])} |"


def _text(text: str) -> str:
    return re.sub(r"``(.+?)``", r"`\1`", " ".join(text.split())).replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
