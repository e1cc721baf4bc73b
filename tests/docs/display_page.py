"""``docs/displays.md`` from the schema of displays: ``python -m tests.docs.display_page`` writes it."""

from __future__ import annotations

from pathlib import Path

from holobench_eval.core.json_schema import json_schemas, resolved
from holobench_eval.display.simulated.profile import STAGES, Profile
from tests.docs.sections import mappings, section

PAGE = Path(__file__).parents[2] / "docs" / "displays.md"

INTRODUCTION = """\
# Your own display

A simulated display is a profile, a YAML file. One that ships is named (`holoeval list profiles`), yours by its
path:

    holoeval new-display my-display      # writes my-display.yaml, every key in it explained
    holoeval list my-display.yaml        # what it says, and its effects
    holoeval show my-display.yaml        # what it does to a hologram, stage by stage

```yaml
display: {profiles: [my-display.yaml], panel: [256, 256]}   # in a study
```

`panel` is what methods are told; all else is what your display does besides, and off unless the file says so. A
file that is `like: leto-2020` has that profile's values where it gives none. The display that stands on your table,
with its camera, has a [bench file](real-bench.md) with the same `panel`.

All lengths are in metres, and one in another unit is refused with what was meant:

```text
holoeval: my-display.yaml:15:17: panel.wavelengths[0]: 532 is not in 200e-9 to 2e-6 m; lengths are in metres: 532e-9
```

## Which distances work

A panel of N pixels of pitch p resolves `wavelength * distance / (N * p)` in the picture, in metres. With the
distance this grows, until the circles that register the camera run into each other; such a display is refused, with
the longest distance that works. On a smaller `panel:` of a study the distance shrinks with its rows. Close to the
panel light spreads over few pixels: on `ideal` with 192 x 192 pixels double-phase encoding has 25 dB on a portrait
at 100 mm, 18 dB at 10 mm and 15 dB at 3 mm, where Wirtinger holography has 29, 26 and 28 dB.

## What is out of scope

- *Amplitude panels*, and those that modulate amplitude and phase at once. Micro-mirrors that switch are amplitude
  panels.
- *Two panels*, one behind the other, and panels that change polarisation.
- *Time multiplexing*: a picture is one frame of each colour; frames that an eye would add up are not shown one by
  one.
- *Fourier holograms*: the picture lies at a finite distance, on the pixels of the panel, and is no larger than it.
- *Two or four wavelengths*: a display has red, green and blue, or one laser and gray pictures. Colours are lit one
  after the other, so there is no crosstalk of colours.
- *Waveguides, holographic lenses and pupil expanders*, and light from several directions at once.
- *Pictures in depth* have one plane each; a [focal stack](focus.md) moves the plane of focus through a hologram.

## The parameters

The source of a model stands above its table; "paper" is Chakravarthula et al. 2020. Numbers in the displays that
ship have their sources beside them in the [files](../holobench_eval/display/simulated/profiles/leto-2020.yaml), and
[bench.md](bench.md) says how the stages follow each other.

<!-- What follows is written by: python -m tests.docs.display_page -->
"""


def page() -> str:
    """The text of the page."""
    schemas, definitions = json_schemas({"display": Profile})
    schema = resolved(schemas["display"], definitions)
    for name, stage in STAGES.items():
        if name in schema["properties"] and name != "panel":
            schema["properties"][name]["description"] = stage.model
    parts = [INTRODUCTION, *section("The document", schema, definitions, units=True)]
    for key, entry in schema["properties"].items():
        for name, inner in mappings(key, entry, definitions):
            note = f"{STAGES[key].title[0].upper()}{STAGES[key].title[1:]}: {STAGES[key].model}."
            parts += section(f"`{name}`", inner, definitions, note, units=True)
    return "\n".join(parts).rstrip("\n") + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
