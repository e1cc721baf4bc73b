"""The keys of a display as tables, from the schema of displays.

The site puts them where ``docs/displays.md`` has ``MARK``.
"""

from pathlib import Path

from holobench_eval.core.parameters import json_schemas, resolved
from holobench_eval.display.simulated.maps import KEYS
from holobench_eval.display.simulated.profile import STAGES, Profile
from tests.docs.sections import mappings, section

PAGE = Path(__file__).parents[2] / "docs" / "displays.md"
MARK = "<!-- On the site the tables of all keys stand here. -->"


def tables() -> str:
    """A section a mapping of the file: title, model of the stage and table."""
    schemas, definitions = json_schemas({"display": Profile})
    schema = resolved(schemas["display"], definitions)
    for name, stage in STAGES.items():
        if name in schema["properties"] and name != "panel":
            schema["properties"][name]["description"] = stage.title
    parts = list(section("The document", schema, definitions, units=True))
    for key, entry in schema["properties"].items():
        for name, inner in mappings(key, entry, definitions):
            parts += section(f"`{name}`", inner, definitions, _note(key), units=True)
    return "\n".join(parts)


def _note(key: str) -> str:
    if key in STAGES:
        return f"{STAGES[key].title[0].upper()}{STAGES[key].title[1:]}: {STAGES[key].model}."
    if key != "maps":
        return ""
    rows = (
        f"| `{name}` | {', '.join(each.axes)} | {each.unit} | {each.low:g} to {each.high:g} | {each.meaning} | "
        f"{', '.join(f'`{other}`' for other in each.instead)} |"
        for name, each in KEYS.items()
    )
    head = "| array | axes | unit | from, to | what it is | takes the place of |\n|---|---|---|---|---|---|"
    return "\n".join((f"{NOTE}\n", head, *rows))


NOTE = """A file of float32 arrays beside the YAML, each optional ([measured maps](#measured-maps)). `rows` and
`columns` are those of the panel, or fewer, which are enlarged bicubically with corners on corners."""
