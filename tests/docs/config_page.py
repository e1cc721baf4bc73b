"""``docs/config.md`` from the schema of configs: ``python -m tests.docs.config_page`` writes it."""

from __future__ import annotations

from pathlib import Path

from holobench_eval.commands.schema import study_schema
from tests.docs.sections import mappings, section

PAGE = Path(__file__).parents[2] / "docs" / "config.md"

INTRODUCTION = """\
# The config of a study

A study is a YAML file: which methods, on which displays, for which targets. This page has every key of it, and says
where paths start and which code a cell depends on. [configs/quick.yaml](../configs/quick.yaml) is the smallest one. A
mistake is one line with its place, and nothing is computed:

```text
holoeval: mine.yaml:4:14: unknown profile 'idel'; did you mean 'ideal'? allowed: ...
```

The YAML is that of the core schema of YAML 1.2 (`yes` is text, `1e-3` a number) without aliases and duplicate keys.
`null` stands for a value that is not there. `holoeval list` shows the names that a config may use,
`holoeval list NAME` what `params` may set. `--set` gives a value of a run on the
[command line](start/first-run.md#a-part-of-a-study-or-a-variant).

## A grid of parameters

`grid` gives a row for each combination of values. They end the row's label, which `baseline`, `question` and
`--methods` name, such as `wirtinger, iterations 10, step 0.5`:

```yaml
methods:
  - {name: wirtinger, grid: {iterations: [10, 50], step: [0.5, 1]}}   # four rows
```

## Where paths start

- Code, `mine.py:Name`, and YAML files of profiles: in the folder of the config, and where it has none, in the working
  directory.
- `display.bench` and `protocol.lpips_weights`: in the folder of the config.
- What `params` hold, such as `path` of the dataset `folder` or `file` of the method `phases`: in the working
  directory, where `holoeval` is called.

## Code of your own

The code of `mine.py:Name` is the file, and what it imports from its own folder or below. No `PYTHONPATH` is needed. A
module of Python's own library goes before a file of the same name, an installed package after it. A change of any
byte of these files, or of a file that is read while they are imported, has the method's cells computed and its
training made again. A `version` of your class is a label for people.

Files that a method opens in `prepare`, `solve` or `predict`, and a dataset for its images, are part of the cells by
their digest where they lie in the folder of the config, or where a parameter names them or a folder above them. Other
files are listed as not covered. Of an installed package all files count, and of this package the versions of the
methods that yours imports.

Not seen is what C code opens by itself (h5py, pyarrow, safetensors, `cv2.FileStorage`) where no parameter names the
file; what other programs and processes read; a listing of a folder, or the question whether a file is there; an
environment variable; and with `isolation: none`, a module that stays in memory from an earlier call.

## In an editor

Editors that know JSON schemas complete keys, show these texts, and mark mistakes. Write the schema once, and name it
in the first line of a config, as `yaml-language-server` (VS Code, Neovim, Emacs and others) reads it:

```sh
holoeval schema > holoeval.schema.json
```

```yaml
# yaml-language-server: $schema=holoeval.schema.json
title: "My study"
```

It knows the parameters of all installed methods and datasets. What is about several values at once, such as a
baseline that is the label of no method, is found by `holoeval plan` alone.

<!-- What follows is written by: python -m tests.docs.config_page -->
"""


def page() -> str:
    """The text of the page."""
    schema = study_schema()
    parts = [INTRODUCTION, *section("The document", schema, schema["$defs"])]
    for key, entry in schema["properties"].items():
        for name, inner in mappings(key, entry, schema["$defs"]):
            parts += section(f"`{name}`", inner, schema["$defs"])
    return "\n".join(parts).rstrip("\n") + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
