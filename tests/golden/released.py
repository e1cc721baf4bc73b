"""``python -m tests.golden.released`` takes the methods, datasets and optics as they are for the released ones."""

import json
from importlib.util import find_spec
from pathlib import Path

from holobench_eval.core.released import FILE, PARTS, code_digest


def digests() -> dict[str, str]:
    """The digest of every module."""
    found = {}
    for part in PARTS:
        spec = find_spec(part)
        assert spec is not None
        assert spec.submodule_search_locations is not None
        (folder,) = map(Path, spec.submodule_search_locations)
        for file in folder.rglob("*.py"):
            name = ".".join((part, *file.relative_to(folder).with_suffix("").parts))
            found[name.removesuffix(".__init__")] = code_digest(file)
    return dict(sorted(found.items()))


if __name__ == "__main__":
    FILE.write_text(f"{json.dumps(digests(), indent=0)}\n", encoding="utf-8")
