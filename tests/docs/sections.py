"""Keys of a file as a table each mapping, from the JSON schema that checks it."""

import json
import re
from collections.abc import Iterator
from typing import Any

from holobench_eval.core.parameters import allowed, resolved

LONGEST = 5  # names that a cell lists; of more, holoeval list has them


def mappings(key: str, entry: Any, definitions: Any) -> Iterator[tuple[str, Any]]:
    """The mappings with keys of their own in a value, by the name of their key."""
    if isinstance(entry, dict):
        inner = resolved(entry, definitions)
        if "properties" in inner:
            yield key, inner
            for name, part in inner["properties"].items():
                yield from mappings(f"{key}.{name}", part, definitions)
        else:
            for part in entry.values():
                yield from mappings(key, part, definitions)
    elif isinstance(entry, list):
        for part in entry:
            yield from mappings(key, part, definitions)


def section(title: str, schema: Any, definitions: Any, note: str = "", units: bool = False) -> Iterator[str]:
    """The lines of a mapping: title, note and table. units: they stand in brackets in the texts, and get a column."""
    head = ["key", *["unit"] * units, "may be (default)", "what it is"]
    yield "\n\n".join([f"## {title}", *[note] * bool(note), f"| {' | '.join(head)} |"]) + f"\n|{'---|' * len(head)}"
    needed = schema.get("required", ())
    for name, entry in schema["properties"].items():
        inside = any(True for _ in mappings(name, entry, definitions))
        default = ", needed" if name in needed else "" if inside and entry.get("default") else _default(entry)
        text = entry["description"].replace("None: ", "null: ").replace("|", "\\|")
        unit = re.search(r" ?\[([^\]]+)\]", text) if units else None
        text = text.replace(unit[0], "", 1).strip() if unit else text
        cells = [f"`{name}`", *[unit[1] if unit else ""] * units, allowed(_short(entry), definitions) + default, text]
        yield f"| {' | '.join(cells)} |".replace("  ", " ")
    yield ""


def _default(entry: Any) -> str:
    return f" (`{json.dumps(entry['default'])}`)" if entry.get("default", "") not in ("", [], {}, None) else ""


def _short(entry: Any) -> Any:
    """A value's schema with words in the place of many names and of patterns of files."""
    if isinstance(entry, list):
        return [_short(part) for part in entry]
    if not isinstance(entry, dict):
        return entry
    if len(entry.get("enum", ())) > LONGEST:
        return {"type": "name"}
    if "pattern" in entry:
        return {"type": "`file.py:Name`" if "py" in entry["pattern"] else "`file.yaml`"}
    return {key: _short(part) for key, part in entry.items()}
