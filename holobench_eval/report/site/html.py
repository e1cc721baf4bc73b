"""How pages are made: templates in which every text is escaped, names of files, and the policy of a page."""

from __future__ import annotations

import re
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from ...core.hashing import digest
from ..data.text import number

# Nothing is loaded but the files of the site; no script, no form, no frame, no address of another place.
POLICY = "default-src 'none'; style-src 'self'; img-src 'self' data:; base-uri 'none'; form-action 'none'"
# Names that become those of other names, or those of devices (on Windows).
_TAKEN = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])?|.*-[0-9a-f]{8}")

_templates = Environment(
    loader=PackageLoader("holobench_eval.report.site"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_templates.filters |= {"number": number}


def page(template: str, depth: int = 0, **values: Any) -> bytes:
    """A page of the site. depth: folders between it and the index."""
    text = _templates.get_template(f"{template}.html").render(policy=POLICY, up="../" * depth, slug=slug, **values)
    return f"{text}\n".encode()


def slug(text: str) -> str:
    """A name as that of a file: no two names share one, on any file system."""
    plain = re.sub(r"[^a-z0-9_-]", "_", text.lower())[:100]
    return plain if plain == text and not _TAKEN.fullmatch(plain) else f"{plain}-{digest(text)[:8]}"
