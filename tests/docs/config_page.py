"""``docs/config.md`` from the schema of configs: ``python -m tests.docs.config_page`` writes it."""

from pathlib import Path

from holobench_eval.commands.schema import study_schema
from tests.docs.sections import mappings, section

PAGE = Path(__file__).parents[2] / "docs" / "config.md"
MARK = "<!-- What follows is written by: python -m tests.docs.config_page -->\n"


def page() -> str:
    """The text of the page: what stands above the mark, and the tables."""
    schema = study_schema()
    parts = [
        PAGE.read_text(encoding="utf-8").partition(MARK)[0] + MARK,
        *section("The document", schema, schema["$defs"]),
    ]
    for key, entry in schema["properties"].items():
        for name, inner in mappings(key, entry, schema["$defs"]):
            parts += section(f"`{name}`", inner, schema["$defs"])
    return "\n".join(parts).rstrip("\n") + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
