"""How pages are made: templates in which every text is escaped, names of files, and the policy of a page."""

from __future__ import annotations

import re
from typing import Any

from ...core.hashing import digest
from ..data.board import GROUPS
from ..data.phrases import verdict
from ..data.text import number
from ..page import templates

# Nothing is loaded but the files of the site; no script, no form, no frame, no address of another place.
POLICY = "default-src 'none'; style-src 'self'; img-src 'self' data:; base-uri 'none'; form-action 'none'"
# Names that become those of other names, or those of devices (on Windows).
_TAKEN = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])?|.*-[0-9a-f]{8}")

_templates = templates("holobench_eval.report.site", "templates")
_templates.globals |= {"GROUPS": GROUPS, "number": number, "verdict": verdict}


def page(template: str, up: str = "../", **values: Any) -> bytes:
    """A page of the site. up: the way from its folder to that of the index."""
    text = _templates.get_template(f"{template}.html").render(policy=POLICY, up=up, slug=slug, **values)
    return f"{text}\n".encode()


def slug(text: str) -> str:
    """A name as that of a file: no two names share one, on any file system."""
    plain = re.sub(r"[^a-z0-9_-]", "_", text.lower())[:100]
    return plain if plain == text and not _TAKEN.fullmatch(plain) else f"{plain}-{digest(text)[:8]}"
