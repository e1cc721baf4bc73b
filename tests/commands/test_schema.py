"""The JSON schema of configs: it takes what ships, and refuses by structure what a config may not be."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from holobench_eval.commands.schema import schema, study_schema
from holobench_eval.core.errors import UserError
from holobench_eval.core.yaml_source import load, parse
from tests.study.test_config import CHANGES, FULL

ROOT = Path(__file__).parents[2]

# Mistakes that only the program finds: they are about other values, files, images and optics, not about structure.
BEYOND = (
    ("profiles: [ideal]\n", "profiles: [ideal, ideal]\n"),
    ("profiles: [ideal]\n", "profiles: [absent.yaml]\n"),
    ("panel: [128, 256]", "panel: [64, 64]"),
    ("panel: [128, 256]", "panel: [1920, 1080]"),
    ('label: "GS"', "label: floor"),
    ("sets.py:Images", "sets.py:Training"),
    ("sets.py:Images", "gone.py:Images"),
    ("count: 3", "cuont: 3"),
    ("count: 3", "count: -3"),
    ("count: 3", "count: 0"),
    ("profiles: [ideal]}", "profiles: [idael]}"),
    ('label: "GS"', 'label: "Wirtinger "'),
    ('label: "GS"', "label: wirtinger"),
    ('label: "GS"', "label: floor_black"),
    ('label: "GS"', 'label: "a\\nb"'),
    ("baseline: GS", "baseline: gs"),
    ("GS: {psnr", "gS: {psnr"),
    ("rows: {GS", "beside: idael, rows: {GS"),
    ("params: {iterations: 12}", "grid: {iterations: [3, 3]}"),
    ('label: "GS"', "grid: {iterations: [3]}"),
    ("repeats: 2", "protocol: {lpips_weights: no.pth}"),
    ("headline: ssim_srgb", "headline: ms_ssim_linear"),
    ("repeats: 2", "protocol: {metrics: [psnr]}"),
    ("repeats: 2", "related: [absent]"),
    ("repeats: 2", "related: [study]"),
    ("repeats: 2", "measure: prediction\nrelated: [study]"),
)


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


@pytest.mark.parametrize(("old", "new"), [(old, new) for old, new, _ in CHANGES])
def test_a_mistake_of_structure_does_not_fit(fits, old, new):
    try:
        data = parse("full.yaml", FULL.replace(old, new, 1)).data
    except UserError:
        return  # no YAML of ours, whatever the schema says
    assert fits(data) == ((old, new) in BEYOND)


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
