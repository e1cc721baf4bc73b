"""The studies of a config file: its first, and its ``parts``, each with the keys that differ from those of the first.

A part is named behind its file: ``configs/depth.yaml/frames`` is the part ``frames`` of ``configs/depth.yaml``.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from .errors import UserError, suggest
from .yaml_source import Document, Keys, Position, dump, load

PARTS = "parts"  # the key of a config
NAME = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*")
# What else lies in the folder of a report.
TAKEN = {"captures", "figures", "journal", "phases", "pictures", "draws", "records", "solved", "training"}


def divided(config: Path) -> tuple[Path, str]:
    """The file of a config, and the name of the part that is meant, empty for the first study."""
    return (config.parent, config.name) if config.parent.is_file() else (config, "")


def load_config(config: Path) -> Document:
    """The keys of a study, with their places in its file; those of the first study have ``parts`` among them.

    The text is that of the file; of a file with parts, the keys of the study alone, as YAML.
    UserError: the file cannot be read, names a part wrongly, or has no such part.
    """
    file, name = divided(config)
    document = load(file)
    parts = _parts(document)
    if name not in ("", *parts):
        raise UserError(f"{file}: no part '{name}'; {suggest(name, parts) if parts else 'it has no parts'}")
    own = {key: value for key, value in document.data.items() if key != PARTS}
    if not name:
        return replace(document, text=dump(own)) if parts else document
    keys = parts[name]
    own = {key: value for key, value in {**own, **keys}.items() if value is not None or key not in keys}

    def placed(positions: dict[Keys, Position]) -> dict[Keys, Position]:
        first = {where: place for where, place in positions.items() if where[:1] not in {(key,) for key in keys}}
        return first | {where[2:]: place for where, place in positions.items() if where[:2] == (PARTS, name)}

    keys_of, values_of = placed(document.keys), placed(document.values)
    return replace(document, text=dump(own), data=own, keys=keys_of, values=values_of)


def _parts(document: Document) -> dict[str, dict[str, Any]]:
    """The keys of each part by its name. UserError: a name that no folder of a report may have, or no mapping."""
    parts = document.data.get(PARTS, {})
    if not isinstance(parts, dict):
        raise document.error((PARTS,), "parts should be a mapping of names to the keys that differ")
    for name, keys in parts.items():
        where: Keys = (PARTS, name)
        if not NAME.fullmatch(name) or name in TAKEN:
            what = "is what a report has itself" if name in TAKEN else "is no name of a part"
            raise document.error(where, f"'{name}' {what}; take lower-case letters, digits and single hyphens", True)
        if not isinstance(keys, dict):
            raise document.error(where, f"part '{name}' should be a mapping of the keys that differ")
        if PARTS in keys:
            raise document.error((*where, PARTS), "a part has no parts", True)
    return parts
