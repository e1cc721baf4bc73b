"""``docs/displays.md`` from the schema of displays: ``python -m tests.docs.display_page`` writes it."""

from __future__ import annotations

from pathlib import Path

from holobench_eval.core.json_schema import json_schemas, resolved
from holobench_eval.display.simulated.profile import STAGES, Profile
from tests.docs.sections import mappings, section

PAGE = Path(__file__).parents[2] / "docs" / "displays.md"

INTRODUCTION = """\
# Your own display

How to describe a simulated display: a profile, which is a YAML file, and every key of it. One that ships is named
(`holoeval list profiles`), yours by its path:

    holoeval new-display my-display      # writes my-display.yaml, every key in it explained
    holoeval list my-display.yaml        # what it says, and its effects
    holoeval show my-display.yaml        # what it does to a hologram, stage by stage

```yaml
display: {profiles: [my-display.yaml], panel: [256, 256]}   # in a study
```

Methods are told `panel`. All else is what your display does besides, and off unless the file says so. A file that is
`like: leto-2020` has that profile's values where it gives none. All lengths are in metres. A real display has a
[bench file](real-bench.md) with the same `panel`.

A display has one phase panel and a camera at a finite distance, lit by red, green and blue one after the other or by
one laser. There are no amplitude panels, second panels, Fourier holograms, added frames or waveguides.

![leto-2020 stage by stage: look-up table, crosstalk,
illumination, iris, sensor, a chart and its capture](../reports/table3/figures/stages-leto-2020.png)

## Which distances work

A panel of N pixels of pitch p resolves `wavelength * distance / (N * p)` in the picture, in metres. This grows with
the distance until the circles that register the camera run into each other: such a display is refused, with the
longest distance that works. On a smaller `panel:` of a study the distance shrinks with its rows. Close to the panel
light spreads over few pixels: on `ideal` with 192 x 192 pixels double-phase encoding has 25 dB on a portrait at
100 mm, 18 dB at 10 mm and 15 dB at 3 mm; Wirtinger holography has 29, 26 and 28 dB.

## The parameters

The source of a model stands above its table; "paper" is Chakravarthula et al. 2020. The displays that ship have the
sources of their numbers in the [files](../holobench_eval/display/simulated/profiles/leto-2020.yaml). How the stages
follow each other: [bench.md](bench.md).

<!-- What follows is written by: python -m tests.docs.display_page -->
"""


def page() -> str:
    """The text of the page."""
    schemas, definitions = json_schemas({"display": Profile})
    schema = resolved(schemas["display"], definitions)
    for name, stage in STAGES.items():
        if name in schema["properties"] and name != "panel":
            schema["properties"][name]["description"] = stage.title
    parts = [INTRODUCTION, *section("The document", schema, definitions, units=True)]
    for key, entry in schema["properties"].items():
        for name, inner in mappings(key, entry, definitions):
            note = f"{STAGES[key].title[0].upper()}{STAGES[key].title[1:]}: {STAGES[key].model}."
            parts += section(f"`{name}`", inner, definitions, note, units=True)
    return "\n".join(parts).rstrip("\n") + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
