"""``holoeval schema``: what a config may say, as a JSON schema for editors."""

from __future__ import annotations

import json
from typing import Any


def schema() -> None:
    """Print a JSON schema of configs, for editors: docs/config.md says how to use it."""
    print(json.dumps(study_schema(), indent=1))


def study_schema() -> dict[str, Any]:
    """The schema of a config, with the names and the parameters of all that is installed."""
    from ..core import plugins
    from ..core.errors import UserError
    from ..core.parameters import json_schemas
    from ..display.simulated.changes import KINDS
    from ..display.simulated.profile import names as profiles
    from ..display.simulated.shelf import installed
    from ..metrics import catalogue, control
    from ..study.definition import Study
    from ..study.identity import SPECKLE
    from ..study.stacks import SCORES

    classes: dict[str, type[Any]] = {"study": Study}
    for kind in plugins.KINDS:
        for name in plugins.names(kind):
            try:
                classes[f"{kind[:-1]} {name}"] = plugins.find(kind, name)
            except UserError:  # it needs what is not installed: its parameters are not known
                continue
    schemas, shared = json_schemas(classes)
    study = schemas.pop("study")
    shared |= {name: entry for name, entry in schemas.items() if "$ref" not in entry}
    references = {name: entry if "$ref" in entry else {"$ref": f"#/$defs/{name}"} for name, entry in schemas.items()}
    study = shared.pop("Study") if "$ref" in study else study
    del shared["Changes"]  # a key of no file

    choices = {kind[:-1]: _one_of(plugins.names(kind), r"\.py:") for kind in plugins.KINDS}
    choices["profile"] = _one_of([*profiles(), *profiles(family=True), *installed()], r"\.ya?ml$")
    for key, definition, what in (
        ("name", "MethodEntry", "method"),
        ("name", "Probe", "method"),
        ("method", "Learned", "method"),
        ("dataset", "Targets", "dataset"),
        ("dataset", "Training", "dataset"),
        ("profile", "Learned", "profile"),
    ):
        entry = shared[definition]["properties"]
        kept = {name: entry[key][name] for name in ("default", "description") if name in entry[key]}
        entry[key] = kept | choices[what]
        shared[definition].setdefault("allOf", []).extend(
            _params_of(key, name.partition(" ")[2], reference, shared[definition], shared)
            for name, reference in references.items()
            if name.startswith(f"{what} ")
        )
    display = shared["DisplayGrid"]
    display["properties"]["profiles"] |= {"items": choices["profile"], "minItems": 1}
    display["oneOf"] = [{"required": [name]} for name in ("profiles", "learned", "bench")]
    shared["Sweep"]["properties"]["condition"] |= {"enum": list(KINDS)}
    metrics = catalogue()
    columns = [*(column for metric in metrics for column in metric.columns), *SCORES]
    study["properties"]["headline"] |= {"enum": columns}
    wanted = {"type": "array", "items": {"enum": [*(metric.name for metric in metrics), SPECKLE, control.NAME]}}
    shared["Protocol"]["properties"]["metrics"] |= {"anyOf": [wanted, {"type": "null"}]}
    entries = study["properties"]["methods"]
    entries["items"] = {"anyOf": [choices["method"], entries["items"]]}
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "holoeval: a study"}
    return head | study | {"$defs": shared}


def _one_of(names: list[str], file: str) -> dict[str, Any]:
    """One of the names, or a file. file: a pattern of its path."""
    return {"anyOf": [{"enum": names}, {"type": "string", "pattern": file}]}


def _params_of(
    key: str, name: str, reference: dict[str, Any], owner: dict[str, Any], shared: dict[str, Any]
) -> dict[str, Any]:
    """What ``params`` and ``grid`` take where ``key`` has a name. owner: the mapping that has all three."""
    default = owner["properties"][key].get("default") == name
    condition = {"properties": {key: {"const": name}}, **({} if default else {"required": [key]})}
    taken = {"params": reference}
    if "grid" in owner["properties"]:
        entries = shared[reference["$ref"].rpartition("/")[2]]["properties"]
        lists = {name: {"type": "array", "minItems": 1, "items": entry} for name, entry in entries.items()}
        taken["grid"] = {"properties": lists, "additionalProperties": False}
    return {"if": condition, "then": {"properties": taken}}
