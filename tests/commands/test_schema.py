"""The JSON schema of configs: it takes what ships, and refuses by structure what a config may not be."""

import json
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from holobench_eval.commands.schema import schema, study_schema
from holobench_eval.core.errors import UserError
from holobench_eval.core.yaml_source import load, parse
from tests.study.test_config import BEYOND, FULL, STRUCTURE

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def known():
    return study_schema()


@pytest.fixture(scope="module")
def fits(known):
    return Draft202012Validator(known).is_valid


def test_the_schema_is_one_and_takes_every_config_that_ships(known, fits):
    Draft202012Validator.check_schema(known)
    for path in sorted((ROOT / "configs").glob("*.yaml")):
        assert fits(load(path).data), path
    assert fits(parse("full.yaml", FULL).data)


def test_a_mistake_of_structure_does_not_fit_and_others_do(fits):
    for fault in STRUCTURE + BEYOND:
        with suppress(UserError):  # no YAML of ours, whatever the schema says
            assert fits(parse("full.yaml", FULL.replace(*fault[:2], 1)).data) == (fault in BEYOND), fault


@pytest.mark.parametrize(
    "text",
    [
        "{name: hil, params: {retrieval: {stepp: 1}}}",
        "{name: hil, params: {retrieval: {step: 0}}}",
        "{name: sgd, params: {privileged: true}}",
        "{params: {iterations: 3}}",
        "{name: hil, grid: {retrieval: [{step: 0.1}, {step: 0}]}}",
    ],
)
def test_parameters_are_those_of_the_method(fits, text):
    data = parse("full.yaml", FULL.replace("- wirtinger", f"- {text}")).data
    assert not fits(data)


def test_parameters_of_a_default_method_are_those_of_that_method(fits):
    data = parse("full.yaml", FULL).data
    assert fits({**data, "holograms": {"params": {"iterations": 3}}})
    assert not fits({**data, "holograms": {"params": {"beta": 0.9}}})


def test_every_key_has_a_description(known):
    def keys(schema: Any, where: str) -> Iterator[tuple[str, Any]]:
        for name, entry in schema.get("properties", {}).items():
            yield f"{where}.{name}", entry

    found = dict(keys(known, "study"))
    for name, definition in known["$defs"].items():
        found |= dict(keys(definition, name))
    assert len(found) > 100
    assert [name for name, entry in found.items() if not entry.get("description")] == []


def test_what_is_printed_is_that_schema(known, capsys):
    schema()
    assert json.loads(capsys.readouterr().out) == known
